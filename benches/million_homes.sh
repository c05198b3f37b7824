#!/usr/bin/env bash
# Times the queries of a service with a million homes in PostgreSQL: `benches/million_homes.sh URL [HOMES]`.
#
# URL is a database of a superuser, such as postgres://postgres@127.0.0.1/test. The script makes a schema in it and removes it at
# the end. The schema has homes (one tenant owns nine in ten), three clips and jobs for each, and an object for each third home.
# VIOLA, by default the `viola` of the PATH, serves and works on it, and `auto_explain` logs every statement with its plan to target/million_homes.log. The
# script prints the number of runs and the longest time in milliseconds of each kind of statement. The rows have empty documents,
# so some requests end in 500 after their rows were read.
set -euo pipefail
cd "$(dirname "$0")/.."
url="$1"
homes="${2:-1000000}"
viola="${VIOLA:-viola}"
schema=viola_million
scratch="$(mktemp -d)"
log=target/million_homes.log
sql() { PGOPTIONS="-csearch_path=$schema" psql -qv ON_ERROR_STOP=1 "$url" "$@"; }
trap 'kill $(jobs -p) 2>/dev/null || true; PGOPTIONS="-cclient_min_messages=warning" psql -qc "DROP SCHEMA IF EXISTS $schema CASCADE" "$url"; rm -rf "$scratch"' EXIT

psql -qc "DROP SCHEMA IF EXISTS $schema CASCADE" -c "CREATE SCHEMA $schema" "$url"
separator='?'
[[ "$url" == *\?* ]] && separator='&'
export VIOLA_DATABASE_URL="$url${separator}options=-csearch_path%3D$schema"
export VIOLA_DATA="$scratch"
"$viola" migrate

begun=$(date +%s)
sql -v homes="$homes" <<'SQL'
CREATE TEMP TABLE sample AS
SELECT n, CASE WHEN n % 10 = 0 THEN 'bolt/' ELSE 'acme/' END || 'home-' || lpad(n::text, 8, '0') AS home,
    CASE WHEN n % 10 = 0 THEN 'bolt' ELSE 'acme' END AS tenant, 1700000000000 + n * 1000 AS at
FROM generate_series(1, :homes) AS n;
INSERT INTO homes (id, tenant, name, created_at, updated_at, map_wanted, map_made, size_bytes)
SELECT home, tenant, 'Home ' || n, at, at, 1, 1, 45000000 FROM sample;
INSERT INTO tenant_sizes (tenant, part, size_bytes)
SELECT tenant, n % 16, SUM(45000000) FROM sample GROUP BY tenant, n % 16;
INSERT INTO lidar_maps (id, home_id, revision, size_bytes, sha256, info, created_at)
SELECT gen_random_uuid(), home, 1, 20000, md5(home), '{}', at FROM sample;
CREATE TEMP TABLE clip AS
SELECT format('%s-%s-7%s', substr(time, 1, 8), substr(time, 9), substr(dice, 1, 21)) AS clip,
    format('%s-%s-7%s', substr(time, 1, 8), substr(time, 9), substr(dice, 22, 21)) AS job, n, home, tenant, at, k
FROM (SELECT sample.*, k, lpad(to_hex(at), 12, '0') AS time,
    regexp_replace(md5(n || '/' || k) || md5(k || '/' || n), '(...)(...)(.{12})(...)(...)(.{12}).*', '\1-8\2-\3\4-8\5-\6') AS dice
    FROM sample, generate_series(1, 3) AS k) AS dated;
INSERT INTO clips (id, home_id, size_bytes, sha256, info, state, reasons, alignment, job_id, created_at, updated_at)
SELECT clip, home, 15000000, md5(clip), '{}', 'failed', '[]', repeat('x', 400), job, at, at FROM clip;
INSERT INTO jobs (id, clip_id, lidar_map_id, state, progress, attempts, max_attempts, run_after, fence, version,
    created_at, updated_at, tenant, position, order_at, started_at, finished_at)
SELECT job, clip, (SELECT id FROM lidar_maps WHERE home_id = clip.home), 'succeeded', 1, 1, 3, at, 1, 5, at, at, tenant, 0, at, at, at
FROM clip WHERE k > 1 OR n % 100 <> 0;
-- One home in a hundred has a job that waits: a backlog as after an outage.
INSERT INTO jobs (id, clip_id, lidar_map_id, state, progress, attempts, max_attempts, run_after, fence, version,
    created_at, updated_at, tenant, position, order_at)
SELECT job, clip, (SELECT id FROM lidar_maps WHERE home_id = clip.home), 'queued', 0, 0, 3, at, 0, 1, at, at, tenant, 0, at
FROM clip WHERE k = 1 AND n % 100 = 0;
INSERT INTO changes (home_id, kind, clip_id, tenant, at, deleted, seq)
SELECT home, 'home', '', tenant, at, 0, n * 4 FROM sample;
INSERT INTO changes (home_id, kind, clip_id, tenant, at, state, deleted, seq)
SELECT home, 'clip', clip, tenant, at, 'failed', 0, n * 4 + k FROM clip;
UPDATE change_counter SET last_seq = :homes * 4 + 4;
INSERT INTO home_objects (home_id, object_id, class, document, tenant)
SELECT home, 'sofa-1', CASE WHEN n % 2 = 0 THEN 'sofa' ELSE 'bed' END, '{}', tenant FROM sample WHERE n % 3 = 0;
-- As autovacuum leaves the tables some minutes later.
VACUUM ANALYZE;
SQL
echo "filled with $homes homes in $(($(date +%s) - begun)) s: $(psql -Atc "SELECT pg_size_pretty(sum(pg_total_relation_size(c.oid))) FROM pg_class c
    JOIN pg_namespace n ON n.oid = c.relnamespace WHERE n.nspname = '$schema' AND c.relkind = 'r'" "$url")"

explain="-csession_preload_libraries%3Dauto_explain%20-cauto_explain.log_min_duration%3D0%20-cauto_explain.log_analyze%3Don"
explain="$explain%20-cauto_explain.log_timing%3Doff%20-cclient_min_messages%3Dlog"
export VIOLA_DATABASE_URL="$url${separator}options=-csearch_path%3D$schema%20$explain"
export RUST_LOG=info,sqlx::postgres::notice=trace
key="$("$viola" keys create --tenant acme --role admin 2>/dev/null)"
"$viola" serve --no-worker --tenant-storage-mb 100000000000 --listen 127.0.0.1:0 >"$scratch/address" 2>"$log" &
until grep -q listening "$scratch/address"; do sleep 0.1; done
base="$(sed 's/listening on //' "$scratch/address")"
ask() { curl -sS -o /dev/null -w '%{http_code} %{time_total} s  '"$2"'\n' -H "authorization: Bearer $key" -X "$1" "$base$2" "${@:3}"; }
ask POST /v1/webhooks -H 'content-type: application/json' -d '{"url": "https://fleet.example/"}'
cursor() { printf %s "$1" | base64 | tr '+/' '-_' | tr -d '=\n'; }
for state in '' '&state=failed' '&state=queued,running'; do
    ask GET "/v1/jobs?limit=200$state"
    ask GET "/v1/jobs?limit=200$state&after=$(cursor 018bedb2-cd00-7000-8000-000000000000)"
done
for home in home-00000001 home-00500001 home-00999999; do
    ask GET "/v1/homes/$home"
    ask GET "/v1/homes/$home/clips"
    ask GET "/v1/homes?limit=200&after=$(cursor $home)"
    ask GET "/v1/objects?class=sofa&limit=200&after=$(cursor "$home sofa-1")"
    ask POST "/v1/homes/$home/clips" --data-binary x
    ask POST /v1/uploads -H 'tus-resumable: 1.0.0' -H 'upload-length: 100' -H "upload-metadata: home $(printf $home | base64)"
    ask PUT "/v1/homes/$home" -H 'content-type: application/json' -d "{\"name\": \"again $RANDOM\"}"
    ask GET "/v1/changes?limit=200&after=$(cursor "2000000.$(date +%s)000")"
done
ask GET "/v1/homes?limit=200&updated_after=$(date -u +%Y-%m-%dT%H:%M:%SZ -d '-1 minute')"
ask GET /readyz
ask DELETE /v1/homes/home-00500001
kill %1
"$viola" work >/dev/null 2>>"$log" &
sleep 5
kill %2 2>/dev/null || true
wait
python3 - "$log" <<'PYTHON'
import json, re, sys
longest, count = {}, {}
for line in open(sys.argv[1]):
    try:
        text = json.loads(line).get("message", "")
    except ValueError:
        continue
    found = re.match(r"duration: ([\d.]+) ms  plan:\s*Query Text: (.*)", text, re.S)
    if found:
        took, statement = float(found[1]), " ".join(re.split(r"\n\w[^\n]*\(cost", found[2])[0].split())[:110]
        longest[statement] = max(longest.get(statement, 0.0), took)
        count[statement] = count.get(statement, 0) + 1
for statement, took in sorted(longest.items(), key=lambda item: -item[1]):
    print(f"{took:9.2f} ms  {count[statement]:4}  {statement}")
PYTHON
