//! `bowwave plan`: what a scenario needs, and why the rest is left out.

use std::path::Path;

use anyhow::Result;
use bowwave_core::{
    event::PixelFormat,
    frame::{
        plan::{SceneNeeds, ScenePlan},
        scene::{Pass, PassDecision},
    },
    model::Model,
    world::{
        boats::Behaviour,
        scenario::{self, Scenario},
    },
};
use bowwave_render::{RenderConfig, Renderer};
use serde::Serialize;

use crate::{
    cli::PlanArgs,
    loading::{LoadedScenario, load_scenario, parse_scenario},
    stdout,
};

/// A plan, as it is printed.
#[derive(Debug, Serialize)]
struct Printed {
    scenario: String,
    size: String,
    boats: Vec<PrintedBoat>,
    /// Parts of the world's stage, with the reason for each that is left out.
    world: Vec<PrintedPass>,
    passes: Vec<PrintedPass>,
    variants: Vec<String>,
    /// As allocated on `device`, for three frames in flight.
    memory: Vec<PrintedMemory>,
    memory_bytes: u64,
    device: String,
}

#[derive(Debug, Serialize)]
struct PrintedBoat {
    name: String,
    model: String,
    side: &'static str,
    triangles: usize,
    length_m: f64,
}

#[derive(Debug, Serialize)]
struct PrintedPass {
    pass: &'static str,
    runs: bool,
    /// Why it is left out, or when it runs.
    why: &'static str,
}

#[derive(Debug, Serialize)]
struct PrintedMemory {
    name: &'static str,
    bytes: u64,
}

/// Prints the plan of a scenario.
pub fn run(arguments: &PlanArgs) -> Result<()> {
    let LoadedScenario { scenario, models, of_boats } = match &arguments.scenario {
        Some(path) => load_scenario(path)?,
        None => parse_scenario(scenario::DEFAULT, "built-in scenario", Path::new(""))?,
    };
    let plan = ScenePlan::new(&SceneNeeds {
        size: arguments.size,
        video: PixelFormat::Rgb,
        picture: arguments.size,
        ..SceneNeeds::of_scenario(&scenario)
    });
    let (memory, device) = memory(&plan, &models);
    let printed = Printed {
        scenario: scenario.name.clone(),
        size: format!("{}x{}", arguments.size.0, arguments.size.1),
        boats: scenario
            .boats
            .iter()
            .zip(&of_boats)
            .filter_map(|(boat, id)| {
                let model = models.get(usize::from(id.0))?;
                Some(PrintedBoat {
                    name: boat.name.clone(),
                    model: boat.model.clone(),
                    side: boat.side.name(),
                    triangles: model.indices.len() / 3,
                    length_m: (model.length_m() * 10.0).round() / 10.0,
                })
            })
            .collect(),
        world: world(&scenario),
        passes: Pass::ALL.into_iter().map(|p| printed_pass(&plan, p)).collect(),
        variants: variants(&plan),
        memory_bytes: memory.iter().map(|m| m.bytes).sum(),
        memory,
        device,
    };
    if arguments.json { stdout::print_json(&printed) } else { stdout::print(text_of(&printed)) }
}

/// What a renderer for the plan allocates, and on which device: made and let go of, not estimated.
fn memory(plan: &ScenePlan, models: &[Model]) -> (Vec<PrintedMemory>, String) {
    match Renderer::new(&RenderConfig::of_plan(plan, None, false), models) {
        Ok((renderer, _)) => {
            let listed = renderer.memory().into_iter().map(|(name, bytes)| PrintedMemory { name, bytes });
            (listed.collect(), renderer.device().name.clone())
        }
        Err(e) => (Vec::new(), format!("none: {e}")),
    }
}

/// The world's parts, and what a scenario does not pay for.
fn world(scenario: &Scenario) -> Vec<PrintedPass> {
    let crewed = scenario.boats.iter().any(|b| matches!(b.behaviour, Behaviour::Crewed(_)));
    let flat = scenario.wave_field().is_flat() && !scenario.sea_from_video;
    let part =
        |pass, runs, when, otherwise| PrintedPass { pass, runs, why: if runs { when } else { otherwise } };
    vec![
        part(
            "crews",
            crewed,
            "60 steps a second, decisions ten times a second",
            "no boat has a crew: none sees the others",
        ),
        part("waves", !flat, "boats within 2.5 km ride them", "a flat sea"),
        part("rounds", scenario.weapon.belt > 0, "while one is in the air", "no rounds in the belt"),
    ]
}

fn printed_pass(plan: &ScenePlan, pass: Pass) -> PrintedPass {
    let (runs, why) = match plan.passes[pass as usize] {
        PassDecision::LeftOut(why) => (false, why.name()),
        PassDecision::Run => (
            true,
            match pass {
                Pass::Video | Pass::Hud => "every frame",
                Pass::Shadow => "frames with a boat in view while the sun shines",
                Pass::Mirror | Pass::Water => {
                    "frames with a reflection or shadow in view, on its pixels only"
                }
                Pass::Wake => "frames with a wake in view, on its pixels only",
                Pass::Boats => "frames with a boat in view, on its pixels only",
                Pass::Noise => "frames with a boat in view while the camera's noise is seen on it",
                Pass::Lamplight => {
                    "frames by night with a searchlight, a flare or a fire, on the pixels that it lights"
                }
                Pass::Lights => "frames between sunset and sunrise with a light in view",
                Pass::Rounds => "frames with a tracer, splash or strike in view",
                Pass::Phantoms => "frames with anything drawn, on the pixels that the own gun and ship hide",
            },
        ),
    };
    PrintedPass { pass: pass.name(), runs, why }
}

fn variants(plan: &ScenePlan) -> Vec<String> {
    let mut variants = vec![format!(
        "video: {:?}, {}",
        plan.video,
        if plan.picture == plan.size { "pixel for pixel" } else { "scaled to cover the screen" }
    )];
    if plan.has(Pass::Water) {
        let method = plan.water.method.name();
        variants.push(format!(
            "water: {method}, Beaufort {}, shadow {:?}",
            plan.water.force.get(),
            plan.water.shadow
        ));
    }
    variants
}

fn text_of(plan: &Printed) -> String {
    let mut text = format!("{} at {}\n\nboats\n", plan.scenario, plan.size);
    for b in &plan.boats {
        text += &format!(
            "  {:<16} {:<14} {:<8} {:>6} triangles, {} m\n",
            b.name, b.model, b.side, b.triangles, b.length_m
        );
    }
    if plan.boats.is_empty() {
        text += "  none\n";
    }
    for (heading, parts) in [("world", &plan.world), ("passes", &plan.passes)] {
        text += &format!("\n{heading}\n");
        for p in parts {
            text += &format!("  {:<8} {:<9} {}\n", p.pass, if p.runs { "runs" } else { "left out" }, p.why);
        }
    }
    text += "\nshader variants\n";
    for v in &plan.variants {
        text += &format!("  {v}\n");
    }
    text += &format!("\nmemory on {}\n", plan.device);
    for m in &plan.memory {
        text += &format!("  {:<28} {:>9.2} MB\n", m.name, m.bytes as f64 * 1e-6);
    }
    text += &format!("  {:<28} {:>9.2} MB\n", "all", plan.memory_bytes as f64 * 1e-6);
    text
}
