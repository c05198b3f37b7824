#!/usr/bin/env python3
"""Attacks one server with everything at once, and prints what an honest tenant and the server's memory feel.

    benches/attacks.py VIOLA [SECONDS]

Starts `VIOLA serve` on loopback with a folder of its own, without workers. One tenant is honest: it reads its homes 20 times a second, and
uploads a clip every two seconds. Another tenant attacks: bodies that do not end (JSON, with and without a key), heads that do not end,
exports and points that are not read, event streams, empty partial uploads, archives that unpack 48 times, dry runs that do not end, sign-ins,
compressed documents, and wrong keys. Each phase takes SECONDS (20):
without attacks, then with them. The attack is a process of its own of the lowest priority, because attackers do not share the server's
processors. Needs Python 3 only.
"""
import http.client
import io
import json
import os
import resource
import socket
import subprocess
import sys
import tarfile
import tempfile
import threading
import time
from pathlib import Path

VIOLA, SECONDS = sys.argv[1], float(sys.argv[2]) if len(sys.argv) == 3 else 20.0
READS_PER_SECOND, READERS = 20, 4
# Sockets of each kind; the sum is beyond the server's bound on connections.
STALLED, UNREAD, STREAMS = 1500, 600, 2000
HOST = "127.0.0.1"


def run(*arguments):
    return subprocess.run([VIOLA, *arguments], check=True, capture_output=True, text=True).stdout.strip()


def request_to(port, key, method, path, body=None, **headers):
    """Returns the status of the answer."""
    connection = http.client.HTTPConnection(HOST, port, timeout=30)
    try:
        headers = {name.replace("_", "-"): value for name, value in headers.items()}
        connection.request(method, path, body, {"Authorization": f"Bearer {key}", **headers})
        answer = connection.getresponse()
        answer.read()
        return answer.status
    except http.client.HTTPException as error:
        raise OSError(repr(error)) from error
    finally:
        connection.close()


class Server:
    def __init__(self, folder):
        data = f"{folder}/data"
        self.keys = {tenant: run("keys", "create", "--data", data, "--tenant", tenant, "--role", "admin").splitlines()[-1].split()[-1]
                     for tenant in ("honest", "hostile")}
        self.log = open(f"{folder}/log", "w")
        self.process = subprocess.Popen([VIOLA, "serve", "--no-worker", "--listen", f"{HOST}:0", "--data", data, "--models", "none"],
                                        stdout=subprocess.PIPE, stderr=self.log, text=True)
        for line in self.process.stdout:
            if "listening on" in line:
                self.port = int(line.rsplit(":", 1)[1].strip().rstrip("/"))
                break

    def request(self, tenant, *request, **headers):
        return request_to(self.port, self.keys[tenant], *request, **headers)

    def memory_mib(self):
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(status.split("VmRSS:")[1].split()[0]) / 1024


class Honest:
    """Reads at a fixed rate and uploads; keeps the time from the due moment to the answer."""

    def __init__(self, server, clip, seconds):
        self.server, self.clip, self.end = server, clip, time.time() + seconds
        self.reads, self.uploads, self.refused, self.peak = [], [], [], 0.0
        threads = [threading.Thread(target=self.read, args=(number,)) for number in range(READERS)]
        threads += [threading.Thread(target=self.upload), threading.Thread(target=self.watch)]
        [thread.start() for thread in threads]
        [thread.join() for thread in threads]

    def timed(self, times, due, *request, **headers):
        try:
            status = self.server.request("honest", *request, **headers)
        except OSError as error:
            status = str(error)
        times.append(time.time() - due)
        if not isinstance(status, int) or status >= 400:
            self.refused.append((request[0], request[1], status))

    def read(self, number):
        paths = ["/v1/homes", "/v1/homes/h", "/v1/homes/h/clips", "/v1/homes/h/lidar-map", "/v1/changes"]
        due = time.time() + number / READS_PER_SECOND
        while due < self.end:
            time.sleep(max(0.0, due - time.time()))
            self.timed(self.reads, due, "GET", paths[len(self.reads) % len(paths)])
            due += READERS / READS_PER_SECOND

    def upload(self):
        while time.time() < self.end:
            self.timed(self.uploads, time.time(), "POST", "/v1/homes/h/clips?title=honest", self.clip)
            time.sleep(2)

    def watch(self):
        while time.time() < self.end:
            self.peak = max(self.peak, self.server.memory_mib())
            time.sleep(0.1)


def tarbomb(clip):
    """A tar.gz of a clip's file and 256 MiB that pack to a fiftieth."""
    out = io.BytesIO()
    with tarfile.open(fileobj=out, mode="w:gz") as archive:
        for name, content in (("clip.zip", clip), ("filler.bin", (os.urandom(21 << 10) + bytes((1 << 20) - (21 << 10))) * 256)):
            info = tarfile.TarInfo(name)
            info.size = len(content)
            archive.addfile(info, io.BytesIO(content))
    return out.getvalue()


class Attack:
    """Attacks until the process is killed."""

    def __init__(self, port, key, clip):
        self.port, self.key, self.sockets = port, key, []
        post = "PUT /v1/session HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\nContent-Length: 60000\r\n\r\n{"
        get = lambda path: f"GET {path} HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {key}\r\n\r\n"
        dry_run = f"POST /v1/homes/x/clips?dry_run=true HTTP/1.1\r\nHost: localhost\r\nAuthorization: Bearer {key}\r\nContent-Length: 60000000\r\n\r\n"
        kinds = [(STALLED, post), (UNREAD, dry_run + "x" * 100_000), (STALLED, "GET / HTTP/1.1\r\nHost: localhost\r\n"), (UNREAD, get("/v1/homes/x/export")),
                 (UNREAD, get("/openapi.json") * 32), (STREAMS, get("/v1/homes/x/events"))]
        bomb = tarbomb(clip)
        loops = [lambda: self.sockets_of(kinds)]
        loops += [lambda: self.again("POST", "/v1/homes/x/clips", bomb)] * 4
        loops += [lambda: self.again("POST", "/v1/uploads", b"", Tus_Resumable="1.0.0", Upload_Concat="partial", Upload_Defer_Length="1")] * 2
        sign_in = json.dumps({"key": key}).encode()
        loops += [lambda: self.again("PUT", "/v1/session", sign_in, Content_Type="application/json")] * 2
        loops += [lambda: self.again("GET", "/openapi.json", Accept_Encoding="br")] * 2
        loops += [self.guess] * 2
        threads = [threading.Thread(target=loop) for loop in loops]
        [thread.start() for thread in threads]
        [thread.join() for thread in threads]

    def sockets_of(self, kinds):
        """Opens sockets of all kinds, and opens closed ones again."""
        while True:
            for count, text in kinds:
                for _ in range(count // 10):
                    try:
                        opened = socket.socket()
                        opened.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
                        opened.settimeout(2)
                        opened.connect((HOST, self.port))
                        opened.sendall(text.encode())
                        self.sockets.append(opened)
                    except OSError:
                        time.sleep(0.01)
            while len(self.sockets) > sum(count for count, _ in kinds):
                self.sockets.pop(0).close()

    def again(self, *request, **headers):
        while True:
            try:
                request_to(self.port, self.key, *request, **headers)
            except OSError:
                time.sleep(0.05)

    def guess(self):
        while True:
            try:
                request_to(self.port, os.urandom(16).hex(), "GET", "/v1/homes")
            except OSError:
                time.sleep(0.05)


def percentile(times, share):
    return sorted(times)[min(len(times) - 1, int(share * len(times)))] if times else float("nan")


def main():
    with tempfile.TemporaryDirectory() as folder:
        run("simulate", "--set", "normal", "--seed", "5000", "--clips", "1", "--frames", "24", "--out", f"{folder}/home")
        clip, lidar = Path(f"{folder}/home/clip_0.zip").read_bytes(), Path(f"{folder}/home/valetudo.json").read_bytes()
        server, attack = Server(folder), None
        try:
            for tenant, home in (("honest", "h"), ("hostile", "x")):
                server.request(tenant, "PUT", f"/v1/homes/{home}", b"{}", Content_Type="application/json")
                server.request(tenant, "PUT", f"/v1/homes/{home}/lidar-map", lidar)
            print("| while | reads | median | 99 % | longest | uploads | longest upload | refused | peak memory |\n|---|---|---|---|---|---|---|---|---|")
            for name in ("without attacks", "all attacks at once"):
                if name != "without attacks":
                    arguments = ["attack", str(server.port), server.keys["hostile"], f"{folder}/home/clip_0.zip"]
                    attack = subprocess.Popen(["nice", "-n", "19", sys.executable, __file__, *arguments])
                    time.sleep(5)
                honest = Honest(server, clip, SECONDS)
                ms = lambda seconds: f"{1000 * seconds:.0f} ms"
                print(f"| {name} | {len(honest.reads)} | {ms(percentile(honest.reads, 0.5))} | {ms(percentile(honest.reads, 0.99))} | "
                      f"{ms(max(honest.reads))} | {len(honest.uploads)} | {ms(max(honest.uploads))} | {len(honest.refused)} | {honest.peak:.0f} MiB |",
                      flush=True)
                if honest.refused:
                    print(json.dumps(honest.refused[:5]), file=sys.stderr)
        finally:
            if attack:
                attack.kill()
            server.process.terminate()
            server.process.wait(30)


if __name__ == "__main__":
    resource.setrlimit(resource.RLIMIT_NOFILE, (20_000, 20_000))
    if sys.argv[1] == "attack":
        Attack(int(sys.argv[2]), sys.argv[3], Path(sys.argv[4]).read_bytes())
    else:
        main()
