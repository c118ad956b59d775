//! All passes of a renderer.

use bowwave_core::{model::Model, water::ReflectionMethod};
use shaders_spirv::interface::{DrawBlock, LightBlock};

use super::{
    PassContext,
    behind_hulls::BehindHulls,
    boats::{BoatsPass, meshes::Meshes},
    hud::HudPass,
    lamplight::LamplightPass,
    lights,
    mirror::MirrorPass,
    phantoms::PhantomPass,
    rounds,
    shadow::ShadowPass,
    video::VideoPass,
    wake::WakePass,
    water::{WaterPass, baked::ReflectPass},
};
use crate::{config::RenderConfig, error::RenderError};

/// The passes that can ever be needed, in the order in which they run.
pub(crate) struct Passes {
    pub(crate) video: VideoPass,
    pub(crate) meshes: Meshes,
    pub(crate) shadow: Option<ShadowPass>,
    pub(crate) mirror: Option<MirrorPass>,
    pub(crate) water: Option<WaterPass>,
    pub(crate) reflect: Option<ReflectPass>,
    pub(crate) wake: Option<WakePass>,
    pub(crate) boats: Option<BoatsPass>,
    pub(crate) lamplight: Option<LamplightPass>,
    pub(crate) lights: Option<BehindHulls<LightBlock>>,
    pub(crate) rounds: Option<BehindHulls<DrawBlock>>,
    pub(crate) phantoms: Option<PhantomPass>,
    pub(crate) hud: HudPass,
}

impl Passes {
    pub(crate) fn new(
        context: &PassContext<'_>,
        config: &RenderConfig,
        models: &[Model],
    ) -> Result<Self, RenderError> {
        let needs = &config.needs;
        let any_boat = needs.boats_max > 0;
        let textured = models.iter().any(|m| m.texture.is_some());
        let meshes = Meshes::new(context, if any_boat { models } else { &[] })?;
        let shadow = any_boat.then(|| ShadowPass::new(context)).transpose()?;
        let drawn = shadow.as_ref().map(|shadow| (&meshes, &shadow.map));
        let reflects = needs.waters.iter().any(|(method, _)| *method != ReflectionMethod::Off);
        let softens = needs.waters.iter().any(|(method, _)| *method == ReflectionMethod::Full);
        let mirror = (any_boat && reflects)
            .then(|| MirrorPass::new(context, &meshes, textured, [softens, needs.lights_max > 0]))
            .transpose()?;
        let water = (any_boat && !needs.waters.is_empty())
            .then(|| WaterPass::new(context, mirror.as_ref(), &needs.waters))
            .transpose()?;
        let reflect = match (&mirror, &water) {
            (Some(mirror), Some(water)) if needs.lobes() > 0 => {
                Some(ReflectPass::new(context, mirror, &water.backdrop, needs.lobes())?)
            }
            _ => None,
        };
        let boats = drawn.map(|drawn| BoatsPass::new(context, drawn, [textured, needs.noise])).transpose()?;
        let shadow_map = shadow.as_ref().map(|shadow| &shadow.map);
        let wake = boats.as_ref().zip(shadow_map).filter(|_| needs.wakes_max > 0);
        let wake = wake.map(|drawn| WakePass::new(context, drawn)).transpose()?;
        let over = boats.as_ref();
        let lamplight = needs.lamps.then(|| LamplightPass::new(context)).transpose()?;
        let lights = BehindHulls::when(needs.lights_max > 0, context, &lights::SHADERS, over)?;
        let rounds = BehindHulls::when(needs.rounds_max > 0, context, &rounds::SHADERS, over)?;
        let phantoms = PhantomPass::new(context, &needs.phantoms)?;
        let hud = HudPass::new(context)?;
        let video = VideoPass::new(context, config.picture, &hud.overlay.layout)?;
        Ok(Self {
            video,
            meshes,
            shadow,
            mirror,
            water,
            reflect,
            wake,
            boats,
            lamplight,
            lights,
            rounds,
            phantoms,
            hud,
        })
    }
}
