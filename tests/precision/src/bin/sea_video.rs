//! Sea state from simulated video.
use std::cell::RefCell;
use bowwave_core::{sea::estimate::{Frame, SeaMeter}, time::Time};
use precision::sea_video::{clips, video::{Clip, Video}};

fn main() {
    let a: Vec<String> = std::env::args().skip(1).collect();
    let verbose = a.iter().any(|s| s == "-v");
    let range: Vec<u64> = a[1].split('-').map(|s| s.parse().unwrap()).collect();
    let part: Vec<u64> = a.get(2).map_or(vec![0, 1], |s| s.split('/').map(|s| s.parse().unwrap()).collect());
    for i in range[0]..range[1] {
        if i % part[1] != part[0] { continue; }
        let clip = if a[0] == "main" { clips::main_clip(i) } else { clips::hard_clip(i) };
        run(&format!("{}{}", a[0], i), clip, verbose);
    }
}

fn run(name: &str, clip: Clip, verbose: bool) {
    let path = format!("/tmp/wt/sea-cache/{name}");
    let cached: Option<Vec<f32>> = std::fs::read(&path).ok().map(|b| b.chunks(4).map(|c| f32::from_le_bytes(c.try_into().unwrap())).collect());
    let hit = cached.is_some();
    let tape = RefCell::new((cached.unwrap_or_default(), 0usize));
    let mut video = Video::new(clip);
    let mut meter = SeaMeter::new();
    meter.sky_share = std::env::var("SKY").ok().and_then(|s| s.parse().ok()).unwrap_or(0.0);
    for i in 0..(66.0 * 30.0) as i64 {
        let time = Time::from_ns(i * 33_333_333);
        let t = time.ns() as f64 * 1e-9;
        if !hit && meter.wants(time) {
            video.advance(t);
        }
        let lens = video.clip.lens;
        let camera = video.told_pose(t);
        let v = &video;
        let look = |p| {
            let mut tape = tape.borrow_mut();
            if hit {
                tape.1 += 1;
                let k = tape.1 - 1;
                return Some(tape.0[k]).filter(|v| v.is_finite());
            }
            let l = v.luminance(p);
            tape.0.push(l.unwrap_or(f32::NAN));
            l
        };
        meter.observe(&Frame { time, camera, lens: &lens, luminance: &look });
    }
    if !hit {
        tape.borrow_mut().0.push(video.seen_m() as f32);
        let bytes: Vec<u8> = tape.borrow().0.iter().flat_map(|v| v.to_le_bytes()).collect();
        std::fs::create_dir_all("/tmp/wt/sea-cache").unwrap();
        std::fs::write(&path, bytes).unwrap();
    }
    let seen = *tape.borrow().0.last().unwrap();
    let c = &video.clip;
    let lines = meter.lines();
    // Research summary.
    let good: Vec<&[f64; 7]> = lines.iter().filter(|l| l[4] > 0.25).collect();
    let mut m0 = 0.0; let (mut a4, mut f4, mut east, mut north) = (0.0, 0.0, 0.0, 0.0);
    for w in lines.windows(2) {
        let d = w[1][0] - w[0][0];
        for l in w { if l[4] > 0.25 {
            m0 += 0.5 * d * l[1];
            a4 += d * l[1].powi(4); f4 += d * l[0] * l[1].powi(4);
            east += d * l[1] * l[2].sin(); north += d * l[1] * l[2].cos();
        } }
    }
    let _ = good;
    let hs = 4.0 * m0.sqrt();
    let tp = a4 / f4;
    let from = (east.atan2(north).to_degrees() + 180.0).rem_euclid(360.0);
    let s = c.systems[0];
    let truth = s.from_rad.to_degrees().rem_euclid(360.0);
    let mut dd = from - truth; if dd > 180.0 { dd -= 360.0 } if dd < -180.0 { dd += 360.0 }
    println!("{name:8} {:14} eye {:4.1} Hs {:.2} seen {:.2} est {hs:.2} ({:.2}/{:.2})  Tp {:.2} est {tp:.2} ({:.2})  from {truth:4.0} est {from:4.0} ({dd:4.0})  {}", c.class, c.eye_m, video.significant_m(), seen, hs / video.significant_m(), hs / f64::from(seen), s.peak_s, tp / s.peak_s, meter.debug().lines().next().unwrap_or(""));
    if verbose { println!("{}", meter.debug()); }
}
