//! The aimed misses of several runs about their targets.

use maud::{Markup, html};

use super::{
    ComparedRun,
    mark::{self, mark},
};
use crate::scored::ExplainedRound;

/// Half a side of the drawing, units.
const HALF: f64 = 100.0;

/// The plot with its legend; nothing where no run has an aimed miss.
pub fn plot(runs: &[ComparedRun]) -> Markup {
    let of: Vec<Vec<&ExplainedRound>> = runs.iter().map(aimed).collect();
    let mut sizes: Vec<f64> =
        of.iter().flatten().map(|round| round.error_m[0].abs().max(round.error_m[1].abs())).collect();
    sizes.sort_by(f64::total_cmp);
    let Some(usual) = sizes.get(sizes.len().saturating_sub(1) * 4 / 5) else { return html! {} };
    // A few that went far off must not hide how the others lie.
    let reach = 1.3 * usual.max(2.0);
    html! {
        section.panel.keep {
            h2 { "Misses about the target" }
            p.muted { "As the shooter saw it: to the right and over are positive. Misses that were aimed, of all runs that are ticked. The plot reaches "
                (format!("{reach:.1} m")) " from the target; rounds farther off are counted beside their run." }
            div.misses {
                (drawing(&of, reach))
                fieldset.legend {
                    legend { "Runs shown" }
                    @for (i, rounds) in of.iter().enumerate() {
                        label { input.screen-only type="checkbox" checked data-run-shown=(i); " " (mark(i)) " Run " (i + 1) ": " (count(rounds, reach)) }
                    }
                }
            }
        }
    }
}

fn aimed(run: &ComparedRun) -> Vec<&ExplainedRound> {
    run.scored.explained.iter().filter(|round| round.was_aimed).collect()
}

fn is_beyond(round: &ExplainedRound, reach: f64) -> bool {
    round.error_m.iter().any(|error| error.abs() > reach)
}

fn count(rounds: &[&ExplainedRound], reach: f64) -> String {
    let beyond = rounds.iter().filter(|round| is_beyond(round, reach)).count();
    let farther = if beyond > 0 { format!(", {beyond} of them farther off") } else { String::new() };
    format!("{} misses{farther}", rounds.len())
}

fn drawing(of: &[Vec<&ExplainedRound>], reach: f64) -> Markup {
    let scale = HALF / reach;
    let step = step(reach);
    let rings: Vec<f64> = (1..).map(|i| f64::from(i) * step).take_while(|ring| *ring <= reach).collect();
    html! {
        svg.plot viewBox="-112 -104 224 222" role="img"
            aria-label="Aimed misses of all runs about the target, metres to the right and over. Each run's own page has the same numbers in its table of rounds." {
            g.grid {
                path d="M-100 0H100M0 -100V100" {}
                @for ring in &rings {
                    circle r=(format!("{:.2}", ring * scale)) {}
                    text x=(format!("{:.2}", ring * scale)) y="-1.5" { (metres(*ring)) }
                    text x="1.5" y=(format!("{:.2}", -ring * scale - 1.0)) { (metres(*ring)) }
                }
                text x="100" y="7" text-anchor="end" { "to the right, m" }
                text x="3" y="-99" { "over, m" }
            }
            @for (i, rounds) in of.iter().enumerate() {
                g class=(mark::class(i)) {
                    @for round in rounds.iter().filter(|round| !is_beyond(round, reach)) {
                        @let [right, over] = round.error_m;
                        (mark::at(i, [right * scale, -over * scale], 1.1, &format!("Run {}, round {}: {}", i + 1, round.shot, round.in_words)))
                    }
                }
            }
        }
    }
}

/// A round distance of which some three reach as far.
fn step(reach_m: f64) -> f64 {
    let power = 10f64.powf((reach_m / 3.0).log10().floor());
    let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| factor * power >= reach_m / 3.0).unwrap_or(10.0);
    factor * power
}

fn metres(distance: f64) -> String {
    if distance < 1.0 { format!("{distance:.1}") } else { format!("{distance:.0}") }
}
