//! GPU timestamps of a frame's parts.

use ash::vk;

use crate::{encoder::CommandEncoder, ring::Span};

/// Timestamps of one frame.
pub(crate) struct Stamps<'a> {
    pub to: CommandEncoder<'a>,
    pub queries: vk::QueryPool,
    /// Whether this frame is timed.
    pub on: bool,
}

impl Stamps<'_> {
    /// Writes the time at which all before it is done.
    pub fn write(&self, query: u32) {
        if self.on {
            let stage = vk::PipelineStageFlags2::ALL_COMMANDS;
            // SAFETY: the command buffer is being recorded and the query was reset in it.
            unsafe { self.to.gpu.device.cmd_write_timestamp2(self.to.cmd, stage, self.queries, query) };
        }
    }

    /// Times what `record` records.
    pub fn around(&self, span: Span, record: impl FnOnce()) {
        self.write(span.first_query());
        record();
        self.write(span.first_query() + 1);
    }
}
