//! Power cuts in a row: each start of the machine checks what the cut before it left, and shoots until the next one.

use std::{
    collections::BTreeMap,
    fs,
    io::Write,
    time::{Duration, Instant},
};

use anyhow::{Context, Result, bail, ensure};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde_json::Value;

use super::bench::{HilBench, Shop, configuration};

/// Longest time from the first commit to the cut.
const SHOOT_MAX_MS: u64 = 6000;
/// So far may the host be out about the machine's time.
const CLOCKS_APART_NS: i64 = 60_000_000;

/// Ten rounds a second from the start to the cut.
const SCENARIO: &str = include_str!("../../data/cuts.toml");

/// Numbers of rounds that the program reported committed.
pub fn committed(lines: &[(i64, String)]) -> Vec<u64> {
    lines.iter().filter_map(|(_, l)| l.strip_prefix("committed ")?.trim().parse().ok()).collect()
}

/// How many of these rounds are not in the newest run but one, or in any where there is but one.
pub fn lost(acknowledged: &[u64], rounds: &[Value]) -> usize {
    let there = |shot: u64| rounds.iter().any(|r| r["shot"].as_u64() == Some(shot));
    acknowledged.iter().filter(|shot| !there(**shot)).count()
}

/// Remains of a cut, as found at the next start.
#[derive(Debug, Default)]
struct Left {
    acknowledged: Vec<u64>,
    /// Machine times between which the trigger was pressed.
    pressed: (i64, i64),
    /// Run that it was.
    run: Option<i64>,
}

/// Does so many cuts; continues a table that is there. Whether nothing was lost or invented.
pub fn run(shop: &mut Shop, count: u32, seed: u64) -> Result<bool> {
    let table = shop.out.join("cuts.csv");
    let data = shop.out.join("cuts-data.img");
    if !table.exists() || !data.exists() {
        // With the LCD, by which the first start is followed.
        shop.used_data("cuts-data.img")?;
        fs::write(&table, "cut,run,shot_for_ms,acknowledged,stored,lost,twice,invented,seconds\n")?;
    }
    for (name, content) in &mut shop.parts.files {
        match name.as_str() {
            "etc/scenario.toml" => *content = SCENARIO.to_owned(),
            "etc/bowwave.toml" => {
                let usual = configuration(&super::bench::Configured::default());
                *content = usual.replace("output = \"lcd\"", "output = \"none\"");
            }
            _ => {}
        }
    }
    let done = fs::read_to_string(&table)?.lines().count().saturating_sub(1) as u32;
    let mut random = Pcg64Mcg::seed_from_u64(seed.wrapping_add(u64::from(done)));
    let mut bad = 0;
    let mut before: Option<Left> = None;
    let mut shot_for = 0;
    for cut in done + 1..=done + count + 1 {
        let begun = Instant::now();
        let mut bench = HilBench::switch_on(shop, &data, "utc")?;
        bench.pull(1, true)?;
        bench.play()?;
        // By then the data partition is mounted. A trigger that was pressed before the trainer looked at it would be no shot.
        bench.says_within("READY", Duration::from_secs(240))?;
        let newest = newest_run(&mut bench)?;
        if let Some(left) = before.take() {
            let verdict = check(&mut bench, &left, newest)?;
            let run = left.run.map_or_else(String::new, |r| r.to_string());
            let line = format!(
                "{},{run},{shot_for},{},{},{},{},{},{:.0}\n",
                cut - 1,
                left.acknowledged.len(),
                verdict.stored,
                verdict.lost,
                verdict.twice,
                verdict.invented,
                begun.elapsed().as_secs_f64()
            );
            eprint!("{line}");
            fs::OpenOptions::new().append(true).open(&table)?.write_all(line.as_bytes())?;
            bad += verdict.lost + verdict.twice + verdict.invented;
        }
        if cut == done + count + 1 {
            break;
        }
        // The line rises between the two times: on a busy host they may be several rounds apart.
        let [[pressed, _]] = bench.pulls(0, vec![(0, true)])?[..] else {
            bail!("the trigger was not pulled once")
        };
        first_commit(&bench)?;
        shot_for = random.random_range(0..SHOOT_MAX_MS);
        std::thread::sleep(Duration::from_millis(shot_for));
        let acknowledged = committed(&bench.machine.guest.lines());
        let until = bench.machine.cut()?;
        // The run that shot was begun in this start.
        before =
            Some(Left { acknowledged, pressed: (pressed, until), run: newest.map(|r| r + 1).or(Some(1)) });
    }
    println!("{}", shop.out.join("cuts.csv").display());
    Ok(bad == 0)
}

/// Number of the newest run that holds rounds.
fn newest_run(bench: &mut HilBench) -> Result<Option<i64>> {
    Ok(rounds(bench)?.iter().filter_map(|r| r["run"].as_i64()).max())
}

fn rounds(bench: &mut HilBench) -> Result<Vec<Value>> {
    // Before the first shot there is no journal.
    match bench.rounds() {
        Err(e) if format!("{e:#}").contains("no journal") => Ok(Vec::new()),
        other => other,
    }
}

fn first_commit(bench: &HilBench) -> Result<()> {
    let until = Instant::now() + Duration::from_secs(240);
    while committed(&bench.machine.guest.lines()).is_empty() {
        ensure!(
            Instant::now() < until,
            "no round was committed: {:?}",
            bench
                .machine
                .guest
                .journal_since(0)
                .iter()
                .rev()
                .take(5)
                .map(|e| e.text().to_owned())
                .collect::<Vec<_>>()
        );
        std::thread::sleep(Duration::from_millis(20));
    }
    Ok(())
}

struct CutVerdict {
    stored: usize,
    lost: usize,
    twice: usize,
    invented: usize,
}

fn check(bench: &mut HilBench, left: &Left, newest: Option<i64>) -> Result<CutVerdict> {
    let all = rounds(bench)?;
    let run = newest.context("the journal holds no round at all")?;
    let rows: Vec<&Value> = all.iter().filter(|r| r["run"].as_i64() == Some(run)).collect();
    let mut seen: BTreeMap<u64, u32> = BTreeMap::new();
    for row in &rows {
        *seen.entry(row["shot"].as_u64().context("a shot's number")?).or_default() += 1;
    }
    // A round is fired while the trigger is pressed, and numbers leave nothing out. The press has the machine's own time, the cut the host's.
    let (from, to) = (left.pressed.0, left.pressed.1 + CLOCKS_APART_NS);
    let outside = |r: &&&Value| r["fired_ns"].as_i64().is_none_or(|f| !(from..to).contains(&f));
    let gaps = seen.keys().zip(seen.keys().skip(1)).filter(|(a, b)| **b != **a + 1).count();
    Ok(CutVerdict {
        stored: rows.len(),
        lost: left.acknowledged.iter().filter(|shot| !seen.contains_key(shot)).count(),
        twice: seen.values().filter(|n| **n > 1).count(),
        invented: rows.iter().filter(outside).count() + gaps,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn commits_are_read_and_missed() {
        let lines =
            [(1, "committed 3".to_owned()), (2, "something".to_owned()), (3, "committed 4".to_owned())];
        let acknowledged = committed(&lines);
        assert_eq!(acknowledged, [3, 4]);
        assert_eq!(lost(&acknowledged, &[json!({ "shot": 3 })]), 1);
        assert_eq!(lost(&acknowledged, &[json!({ "shot": 3 }), json!({ "shot": 4 })]), 0);
    }
}
