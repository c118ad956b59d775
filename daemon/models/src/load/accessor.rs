//! Numbers out of buffers, every access checked.

use gltf::json::{
    Index,
    accessor::{Accessor, ComponentType, Type},
    validation::Checked,
};

use super::source::ModelSource;
use crate::error::ModelError;

impl ModelSource<'_> {
    /// Elements as floats, integers scaled to 0 to 1 (-1 to 1 where signed); components that the accessor does not have
    /// are 1. `types` are the shapes that are taken.
    pub(crate) fn floats(&self, index: Index<Accessor>, types: &[Type]) -> Result<Vec<[f32; 4]>, ModelError> {
        let (accessor, component, shape) = self.accessor(index)?;
        if !types.contains(&shape) {
            return Err(
                self.error(format!("accessor {} has the shape {shape:?}, expected {types:?}", index.value()))
            );
        }
        let width = shape.multiplicity();
        self.elements(index, accessor, component, width, |bytes| {
            let mut out = [1.0; 4];
            for (value, raw) in out.iter_mut().zip(bytes.chunks_exact(component.size())) {
                *value = number(component, raw);
            }
            out
        })
    }

    /// Elements as indices.
    pub(crate) fn indices(&self, index: Index<Accessor>) -> Result<Vec<u32>, ModelError> {
        let (accessor, component, shape) = self.accessor(index)?;
        let whole = matches!(component, ComponentType::U8 | ComponentType::U16 | ComponentType::U32);
        if shape != Type::Scalar || !whole {
            return Err(self
                .error(format!("accessor {} holds no indices: {shape:?} of {component:?}", index.value())));
        }
        self.elements(index, accessor, component, 1, |bytes| {
            bytes.iter().rev().fold(0_u32, |value, &byte| value << 8 | u32::from(byte))
        })
    }

    /// How many elements an accessor states.
    pub(crate) fn count(&self, index: Index<Accessor>) -> u64 {
        self.root().accessors.get(index.value()).map_or(0, |a| a.count.0)
    }

    fn accessor(&self, index: Index<Accessor>) -> Result<(&Accessor, ComponentType, Type), ModelError> {
        let missing = || self.error(format!("accessor {} is not there", index.value()));
        let accessor = self.root().accessors.get(index.value()).ok_or_else(missing)?;
        match (&accessor.component_type, &accessor.type_) {
            (Checked::Valid(component), Checked::Valid(shape)) => Ok((accessor, component.0, *shape)),
            _ => Err(missing()),
        }
    }

    fn elements<T>(
        &self,
        index: Index<Accessor>,
        accessor: &Accessor,
        component: ComponentType,
        width: usize,
        read: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, ModelError> {
        let i = index.value();
        let view = match (accessor.buffer_view, &accessor.sparse) {
            (Some(view), None) => view.value(),
            _ => return Err(self.error(format!("accessor {i} is sparse, which is not read"))),
        };
        let size = component.size() * width;
        let stride = self.root().buffer_views.get(view).and_then(|v| v.byte_stride).map_or(size, |s| s.0);
        if stride < size {
            return Err(
                self.error(format!("accessor {i} has a stride of {stride} bytes for elements of {size}"))
            );
        }
        let outside = || self.error(format!("accessor {i} reaches beyond its buffer view"));
        let bytes = self.view(view)?;
        let offset = usize::try_from(accessor.byte_offset.unwrap_or_default().0).map_err(|_| outside())?;
        let bytes = bytes.get(offset..).ok_or_else(outside)?;
        let count = usize::try_from(accessor.count.0).map_err(|_| outside())?;
        let needed = match count.checked_sub(1) {
            Some(steps) => steps.checked_mul(stride).and_then(|n| n.checked_add(size)).ok_or_else(outside)?,
            None => 0,
        };
        if needed > bytes.len() {
            return Err(outside());
        }
        // The last element need not be followed by a whole stride.
        Ok((0..count).filter_map(|k| bytes.get(k * stride..k * stride + size)).map(read).collect())
    }
}

fn number(component: ComponentType, raw: &[u8]) -> f32 {
    match (component, raw) {
        (ComponentType::F32, &[a, b, c, d]) => f32::from_le_bytes([a, b, c, d]),
        (ComponentType::U8, &[a]) => f32::from(a) / 255.0,
        (ComponentType::U16, &[a, b]) => f32::from(u16::from_le_bytes([a, b])) / 65_535.0,
        (ComponentType::I8, &[a]) => (f32::from(a as i8) / 127.0).max(-1.0),
        (ComponentType::I16, &[a, b]) => (f32::from(i16::from_le_bytes([a, b])) / 32_767.0).max(-1.0),
        (ComponentType::U32, &[a, b, c, d]) => u32::from_le_bytes([a, b, c, d]) as f32,
        _ => f32::NAN,
    }
}
