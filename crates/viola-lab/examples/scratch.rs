use std::collections::BTreeMap;
use viola_geometry::taxonomy::Class;
use viola_home::{objects, rooms};
use viola_lab::evaluate::home::{SampleParams, match_objects, sample};
use viola_lab::simulate::{HomeParams, Set};
fn main() {
    let args: Vec<u64> = std::env::args().skip(1).map(|a| a.parse().unwrap()).collect();
    let mut miss: BTreeMap<String, usize> = BTreeMap::new();
    let (mut t, mut f, mut m) = (0, 0, 0);
    for seed in args[0]..args[1] {
        let map = sample(&HomeParams::new(Set::Normal, seed), &SampleParams { rays: 6000, ..SampleParams::default() }).unwrap();
        let rooms = rooms(&map.lidar, &map.points);
        let found = objects(&map.points, &rooms, &Default::default());
        let matched = match_objects(&map, &found);
        for (i, o) in found.iter().filter(|o| viola_home::is_furniture(o.class)).enumerate() {
            let hit = matched.of_truth.iter().any(|h| h.is_some_and(|(k, _)| k == i));
            if hit || o.size_m.iter().any(|s| *s > 0.5) { println!("CONF {:?} {:.3} {} {}", o.class, o.confidence, hit as u8, o.points); }
        }
        let furniture: Vec<_> = found.iter().filter(|o| viola_home::is_furniture(o.class)).collect();
        (t, f, m) = (t + matched.total.truth, f + matched.total.found, m + matched.total.matched);
        let b = |b: &viola_home::UprightBox| format!("{:.2}x{:.2}x{:.2}@{:.2}", b.size_m[0], b.size_m[1], b.size_m[2], b.bottom_m());
        for truth in &map.truth {
            if !matches!(truth.class, Class::Shelf | Class::Cabinet) { continue }
            let (mut up, mut down, mut side) = (0, 0, 0);
            for p in &map.points {
                let at = p.point.position_m.map(f64::from);
                if truth.bounds.holds(&at, 0.03) && matches!(p.point.label.class, Class::Shelf | Class::Cabinet) { let z = p.point.normal[2]; let h = at[2]; let (lo, hi) = (truth.bounds.bottom_m(), truth.bounds.top_m()); if z.abs() > 0.8 && h > lo + 0.12 && h < hi - 0.12 { up += 1 } else if z < -0.8 { down += 1 } else { side += 1 } }
            }
            let all = (up + down + side).max(1) as f64;
            println!("LEVEL {:?} {} {:.2} {:.2} {:.2} {}", truth.class, (truth.bounds.bottom_m() > 1.0) as u8, up as f64 / all, down as f64 / all, side as f64 / all, b(&truth.bounds));
        }
        for (truth, hit) in map.truth.iter().zip(&matched.of_truth) {
            if hit.is_some() { continue }
            let mut labels: BTreeMap<Class, usize> = BTreeMap::new();
            let mut total = 0;
            for p in &map.points {
                let at = p.point.position_m.map(f64::from);
                if truth.bounds.holds(&at, 0.03) { total += 1; *labels.entry(p.point.label.class).or_default() += 1; }
            }
            let mut best: Vec<_> = labels.into_iter().collect();
            best.sort_by_key(|(_, n)| std::cmp::Reverse(*n));
            let mut near: Vec<_> = furniture.iter().map(|o| (o.bounds().iou(&truth.bounds), o)).filter(|(iou, _)| *iou > 0.02).collect();
            near.sort_by(|a, b| b.0.total_cmp(&a.0));
            let mut close: Vec<_> = furniture.iter().map(|o| (((o.centre_m[0]-truth.bounds.centre_m[0]).powi(2)+(o.centre_m[1]-truth.bounds.centre_m[1]).powi(2)).sqrt(), o)).filter(|(d, o)| *d < 0.8 && o.class == truth.class).collect();
            close.sort_by(|a, b| a.0.total_cmp(&b.0));
            if let Some((d, o)) = close.first() { print!("[close {d:.2} {} yaw {:.2}/{:.2}] ", b(&o.bounds()), o.yaw_rad, truth.bounds.yaw_rad); }
            println!("MISS {seed} {:?} {} points {total} {:?} near {:?}", truth.class, b(&truth.bounds), best.iter().take(4).map(|(c, n)| format!("{c:?} {n}")).collect::<Vec<_>>(), near.iter().take(3).map(|(iou, o)| format!("{:?} {} iou {iou:.2} conf {:.2}", o.class, b(&o.bounds()), o.confidence)).collect::<Vec<_>>());
            let kind = match near.first() { None => "nothing".to_owned(), Some((iou, o)) if o.class == truth.class => format!("same class {}", if *iou >= 0.25 {"taken"} else {"box"}), Some((iou, o)) if *iou > 0.25 => format!("called {:?}", o.class), Some(_) => "touched".into() };
            *miss.entry(format!("MISS {:?}: {kind}", truth.class)).or_default() += 1;
        }
        for (i, o) in furniture.iter().enumerate() {
            if matched.of_truth.iter().any(|h| h.is_some_and(|(k, _)| k == i)) || o.size_m.iter().all(|s| *s <= 0.5) { continue }
            let mut near: Vec<_> = map.truth.iter().map(|t| (o.bounds().iou(&t.bounds), t)).filter(|(iou, _)| *iou > 0.02).collect();
            near.sort_by(|a, b| b.0.total_cmp(&a.0));
            let mut really: BTreeMap<Class, usize> = BTreeMap::new();
            for p in &map.points {
                let at = p.point.position_m.map(f64::from);
                if o.bounds().holds(&at, 0.03) { *really.entry(*Class::ALL.iter().find(|c| c.color() == p.point.color).unwrap()).or_default() += 1; }
            }
            let mut really: Vec<_> = really.into_iter().collect();
            really.sort_by_key(|(_, n)| std::cmp::Reverse(*n));
            print!("{:?} ", really.iter().take(3).map(|(c, n)| format!("{c:?} {n}")).collect::<Vec<_>>());
            println!("FALSE {seed} {:?} {} conf {:.2} points {} near {:?}", o.class, b(&o.bounds()), o.confidence, o.points, near.iter().take(3).map(|(iou, t)| format!("{:?} {} iou {iou:.2}", t.class, b(&t.bounds))).collect::<Vec<_>>());
            let kind = match near.first() { None => "nothing".to_owned(), Some((iou, t)) if t.class == o.class => format!("same {}", if *iou >= 0.25 {"second"} else {"box"}), Some((iou, t)) if *iou > 0.25 => format!("is {:?}", t.class), Some(_) => "touches".into() };
            *miss.entry(format!("FALSE {:?}: {kind}", o.class)).or_default() += 1;
        }
    }
    let mut all: Vec<_> = miss.into_iter().collect();
    all.sort_by_key(|(_, n)| std::cmp::Reverse(*n));
    for (k, n) in all { println!("{n} {k}"); }
    println!("recall {:.1} precision {:.1} ({t} {f} {m})", 100.0 * m as f64 / t as f64, 100.0 * m as f64 / f as f64);
}
