//! Temporary: plans of sampled homes by computed and by the robot's rooms.
use std::collections::VecDeque;
use std::time::Instant;
use viola_formats::lidar::{LidarMap, Room};
use viola_geometry::Point2;
use viola_home as home;
use viola_lab::evaluate::home::{PlanScore, SampleParams, sample, score_plan};
use viola_lab::simulate::{Home, HomeParams, Set};

fn shifted(rooms: &[Room], lidar: &LidarMap, seed: u64) -> Vec<Room> {
    // Cores grow with delays, so that borders lie off the doorways.
    let cells = lidar.cells.as_ref().unwrap();
    let frame = cells.frame;
    let mut owner = vec![0usize; frame.len()];
    for (n, room) in rooms.iter().enumerate() {
        for p in &room.cells_m {
            if let Some((x, y)) = frame.cell(p) {
                owner[y * frame.width + x] = n + 1;
            }
        }
    }
    let reach = (0.6 / frame.cell_m) as i64;
    let at = |x: i64, y: i64| {
        if x < 0 || y < 0 || x >= frame.width as i64 || y >= frame.height as i64 {
            0
        } else {
            owner[y as usize * frame.width + x as usize]
        }
    };
    // geodesic distance to another room
    let mut far = vec![i64::MAX; owner.len()];
    let mut open = VecDeque::new();
    for k in 0..owner.len() {
        let (x, y) = ((k % frame.width) as i64, (k / frame.width) as i64);
        if owner[k] == 0 {
            continue;
        }
        for (dx, dy) in [(1, 0), (-1, 0), (0, 1), (0, -1)] {
            let o = at(x + dx, y + dy);
            if o != 0 && o != owner[k] {
                far[k] = 0;
            }
        }
        if far[k] == 0 {
            open.push_back(k);
        }
    }
    let steps = |k: usize| {
        let (x, y) = ((k % frame.width) as i64, (k / frame.width) as i64);
        [(1, 0), (-1, 0), (0, 1), (0, -1)].map(|(dx, dy)| (x + dx, y + dy))
    };
    while let Some(k) = open.pop_front() {
        for (x, y) in steps(k) {
            if at(x, y) == 0 {
                continue;
            }
            let n = y as usize * frame.width + x as usize;
            if far[n] == i64::MAX {
                far[n] = far[k] + 1;
                open.push_back(n);
            }
        }
    }
    let mut new = vec![0usize; owner.len()];
    let mut queues: Vec<VecDeque<usize>> = vec![VecDeque::new(); 40];
    let delay = |n: usize| ((n as u64 * 2654435761 + seed * 97) % 11) as usize;
    for k in 0..owner.len() {
        if owner[k] != 0 && far[k] > reach {
            new[k] = owner[k];
            queues[delay(owner[k])].push_back(k);
        }
    }
    let mut level = 0;
    let mut next: VecDeque<usize> = VecDeque::new();
    loop {
        let mut now: VecDeque<usize> = std::mem::take(&mut next);
        if level < queues.len() {
            now.extend(std::mem::take(&mut queues[level]));
        }
        if now.is_empty() && level >= queues.len() {
            break;
        }
        while let Some(k) = now.pop_front() {
            for (x, y) in steps(k) {
                if at(x, y) == 0 {
                    continue;
                }
                let n = y as usize * frame.width + x as usize;
                if new[n] == 0 {
                    new[n] = new[k];
                    next.push_back(n);
                }
            }
        }
        level += 1;
        if level > 100000 {
            break;
        }
    }
    rooms
        .iter()
        .enumerate()
        .map(|(n, room)| Room {
            cells_m: (0..new.len())
                .filter(|k| new[*k] == n + 1)
                .map(|k| frame.centre(k % frame.width, k / frame.width))
                .collect::<Vec<Point2>>(),
            ..room.clone()
        })
        .collect()
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let range = args[0].split_once("..").unwrap();
    let seeds = range.0.parse::<u64>().unwrap()..range.1.parse::<u64>().unwrap();
    let variants: Vec<&str> =
        args.get(1).map_or(vec!["computed", "robot", "shifted", "one", "wide"], |v| v.split(',').collect());
    let sets = args.get(2).map_or(vec![Set::Normal, Set::Changed], |s| {
        s.split(',').map(|n| if n == "normal" { Set::Normal } else { Set::Changed }).collect()
    });
    let save = args.get(3);
    for set in sets {
        let mut scores: Vec<PlanScore> = variants.iter().map(|_| PlanScore::default()).collect();
        let mut parts = vec![0.0f64; variants.len()];
        let mut rooms_n = vec![0usize; variants.len()];
        for seed in seeds.clone() {
            let params = HomeParams::new(set, seed);
            let map = sample(&params, &SampleParams::default()).unwrap();
            let full = Home::generate(&params).survey().lidar_map().unwrap();
            for (v, variant) in variants.iter().enumerate() {
                let mut lidar = map.lidar.clone();
                match *variant {
                    "robot" => lidar.rooms = full.rooms.clone(),
                    "shifted" => lidar.rooms = shifted(&full.rooms, &full, seed),
                    "one" => {
                        lidar.rooms = vec![Room {
                            cells_m: full.rooms.iter().flat_map(|r| r.cells_m.clone()).collect(),
                            ..full.rooms[0].clone()
                        }]
                    }
                    "wide" => {
                        // Each room of the truth, also where an open plan joins them.
                        let inside = |corners: &[Point2; 4], p: &Point2| {
                            (0..4).all(|i| (corners[(i + 1) % 4] - corners[i]).perp(&(p - corners[i])) >= 0.0)
                        };
                        let mut rooms: Vec<Room> = map
                            .rooms
                            .iter()
                            .enumerate()
                            .map(|(n, room)| Room {
                                id: n.to_string(),
                                name: Some(room.name.clone()),
                                material: None,
                                cells_m: vec![],
                            })
                            .collect();
                        for p in full.rooms.iter().flat_map(|r| &r.cells_m) {
                            let distance = |corners: &[Point2; 4]| {
                                if inside(corners, p) {
                                    return 0.0;
                                }
                                (0..4)
                                    .map(|i| {
                                        let (a, b) = (corners[i], corners[(i + 1) % 4]);
                                        let t =
                                            ((p - a).dot(&(b - a)) / (b - a).norm_squared()).clamp(0.0, 1.0);
                                        (p - (a + (b - a) * t)).norm()
                                    })
                                    .fold(f64::MAX, f64::min)
                            };
                            let nearest = (0..map.rooms.len())
                                .min_by(|a, b| {
                                    distance(&map.rooms[*a].corners_m)
                                        .total_cmp(&distance(&map.rooms[*b].corners_m))
                                })
                                .unwrap();
                            rooms[nearest].cells_m.push(*p);
                        }
                        lidar.rooms = rooms.into_iter().filter(|r| !r.cells_m.is_empty()).collect();
                    }
                    _ => {}
                }
                let rooms = home::rooms(&lidar, &map.points);
                let objects = home::objects(&map.points, &rooms, &home::ObjectsParams { voxel_m: 0.05 });
                let begun = Instant::now();
                let plan = home::plan(&lidar, &map.points, &rooms, &objects);
                parts[v] += begun.elapsed().as_secs_f64();
                rooms_n[v] += plan.rooms.len();
                if std::env::var("PLAN_DEBUG").is_ok() {
                    eprintln!(
                        "== {} {seed} {variant}: {} swings of {} doors",
                        set.name(),
                        plan.openings.iter().filter(|o| o.swing.is_some()).count(),
                        plan.openings.iter().filter(|o| o.kind == home::OpeningKind::Door).count()
                    );
                }
                score_plan(&map.plan, &plan, &mut scores[v]);
                if let Some(folder) = save {
                    std::fs::write(
                        format!("{folder}/{}_{seed}_{variant}.png", set.name()),
                        home::plan_png(&plan),
                    )
                    .unwrap();
                }
            }
        }
        for (v, variant) in variants.iter().enumerate() {
            println!("{} {variant}: {:.2} s, {} plan rooms", set.name(), parts[v], rooms_n[v]);
            println!("{}", scores[v].markdown().lines().last().unwrap());
        }
    }
}
