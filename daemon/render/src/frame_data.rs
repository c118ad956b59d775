//! The per-slot upload buffer: one block for each thing that the shaders read, in fixed regions, written by the host before each
//! submission.

use std::sync::Arc;

use ash::vk;
use bowwave_core::frame::lamplight::NODES_MAX;
use bytemuck::Pod;
use shaders_spirv::interface::{
    BOAT_BLOCKS_MAX, BoatBlock, FrameBlock, HudQuad, LamplightNode, LobeBlock, MethodBytes, PHYSICS_WAVES,
    RoundBlock, WATERS_MAX, WakeBlock, WaterBlock,
};

use crate::{
    error::RenderError,
    gpu::Gpu,
    memory::{Access, Buffer},
    pipeline::{Bound, SetLayout, SetPool},
};

/// Most quads of the head-up display: a calibration's page with long texts.
pub(crate) const QUADS_MAX: usize = 640;

/// Most vectors of the frame's list: a rectangle is one, a strip of water two.
pub(crate) const RECTS_MAX: usize = 4096;

/// Offset and bytes of each region.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Region {
    offset: u64,
    size: u64,
}

/// How many of each thing there can be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Capacity {
    pub(crate) boats: usize,
    pub(crate) rounds: usize,
    /// Boats whose light waves throw back.
    pub(crate) lobes: usize,
    /// Navigation lights.
    pub(crate) lights: usize,
    /// Lamps may be asked for: a searchlight, flares, fires.
    pub(crate) lamps: bool,
    /// Boats that leave a wake.
    pub(crate) wakes: usize,
}

/// One slot's upload buffer with the descriptor set that points into it.
pub(crate) struct FrameData {
    buffer: Buffer,
    regions: [Region; REGIONS],
    pub(crate) set: vk::DescriptorSet,
}

/// Bindings of set 0.
const REGIONS: usize = 11;

/// Descriptor kinds of set 0.
const fn kinds() -> [vk::DescriptorType; REGIONS] {
    const STORAGE: vk::DescriptorType = vk::DescriptorType::STORAGE_BUFFER;
    const UNIFORM: vk::DescriptorType = vk::DescriptorType::UNIFORM_BUFFER;
    [UNIFORM, STORAGE, UNIFORM, STORAGE, STORAGE, STORAGE, STORAGE, STORAGE, UNIFORM, UNIFORM, STORAGE]
}

/// Layout of set 0.
pub(crate) fn frame_set_layout(gpu: &Arc<Gpu>) -> Result<SetLayout, RenderError> {
    SetLayout::new(gpu, &kinds(), vk::ShaderStageFlags::VERTEX | vk::ShaderStageFlags::FRAGMENT)
}

impl FrameData {
    pub(crate) fn new(
        gpu: &Arc<Gpu>,
        pool: &SetPool,
        layout: &SetLayout,
        capacity: Capacity,
    ) -> Result<Self, RenderError> {
        let align = gpu
            .limits
            .min_uniform_buffer_offset_alignment
            .max(gpu.limits.min_storage_buffer_offset_alignment)
            .max(64);
        let sizes = [
            size_of::<FrameBlock>(),
            size_of::<BoatBlock>() * BOAT_BLOCKS_MAX,
            size_of::<WaterBlock>() * WATERS_MAX,
            size_of::<RoundBlock>() * capacity.rounds.max(1),
            size_of::<HudQuad>() * QUADS_MAX,
            size_of::<[f32; 4]>() * RECTS_MAX,
            size_of::<LobeBlock>() * capacity.lobes.max(1),
            size_of::<WakeBlock>() * capacity.wakes.max(1),
            size_of::<MethodBytes>() * WATERS_MAX,
            size_of::<[f32; 4]>() * PHYSICS_WAVES,
            size_of::<LamplightNode>() * if capacity.lamps { NODES_MAX } else { 1 },
        ];
        let mut end = 0;
        let regions = sizes.map(|size| {
            let region = Region { offset: end, size: size as u64 };
            end = (end + region.size).next_multiple_of(align);
            region
        });
        let usage = vk::BufferUsageFlags::UNIFORM_BUFFER | vk::BufferUsageFlags::STORAGE_BUFFER;
        let buffer = Buffer::new(gpu, "frame data", end, usage, Access::Upload)?;
        let bound: [Bound; REGIONS] = std::array::from_fn(|i| {
            let (buffer, Region { offset, size }) = (buffer.raw, regions[i]);
            if kinds()[i] == vk::DescriptorType::UNIFORM_BUFFER {
                Bound::Uniform { buffer, offset, size }
            } else {
                Bound::Storage { buffer, offset, size }
            }
        });
        let set = pool.set(layout, &bound)?;
        Ok(Self { buffer, regions, set })
    }

    pub(crate) fn write_frame(&mut self, block: &FrameBlock) {
        self.write(0, std::slice::from_ref(block));
    }

    pub(crate) fn write_boats(&mut self, blocks: &[BoatBlock]) {
        self.write(1, blocks);
    }

    pub(crate) fn write_waters(&mut self, blocks: &[WaterBlock]) {
        self.write(2, blocks);
    }

    pub(crate) fn write_rounds(&mut self, blocks: &[RoundBlock]) {
        self.write(3, blocks);
    }

    pub(crate) fn write_quads(&mut self, blocks: &[HudQuad]) {
        self.write(4, blocks);
    }

    pub(crate) fn write_rects(&mut self, rects: &[[f32; 4]]) {
        self.write(5, rects);
    }

    pub(crate) fn write_lobes(&mut self, blocks: &[LobeBlock]) {
        self.write(6, blocks);
    }

    pub(crate) fn write_wakes(&mut self, blocks: &[WakeBlock]) {
        self.write(7, blocks);
    }

    pub(crate) fn write_methods(&mut self, blocks: &[f32]) {
        self.write(8, blocks);
    }

    /// Waves of the corrected Physics shader.
    pub(crate) fn write_waves(&mut self, waves: &[[f32; 4]]) {
        self.write(9, waves);
    }

    /// Light at the nodes of the lamps' grid.
    pub(crate) fn write_lamplight(&mut self, nodes: &[LamplightNode]) {
        self.write(10, nodes);
    }

    fn write<T: Pod>(&mut self, region: usize, blocks: &[T]) {
        let Region { offset, size } = self.regions[region];
        let bytes: &[u8] = bytemuck::cast_slice(blocks);
        let room = usize::try_from(size).unwrap_or(0).min(bytes.len());
        self.buffer.write(offset, &bytes[..room]);
    }
}
