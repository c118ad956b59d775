//! GoPro's metadata format GPMF: the streams of one payload, and what of them an inertial unit needs.
//!
//! A payload is a row of items: a key of four characters, a kind, the size of one element, a count (big-endian), and the elements, filled up
//! to four bytes. An item of kind 0 is a container of items. A stream (`STRM`) is a container without containers; its last item holds the
//! data, those before it say how to read them. Source: GoPro's gpmf-parser, README ("GPMF KLV").

use glam::DVec3;

/// Deepest nesting of containers that is followed; cameras write two levels.
const DEPTH_MAX: usize = 16;
/// Bytes of an item before its data.
const HEAD_BYTES: usize = 8;

/// A payload that does not follow the format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub(crate) enum GpmfError {
    /// An item is longer than what holds it.
    #[error("an item {key:?} of {bytes} bytes stands in {left}")]
    Overlong {
        /// The item's key.
        key: [u8; 4],
        /// Length of its data.
        bytes: usize,
        /// Bytes that are there.
        left: usize,
    },
    /// Containers within containers.
    #[error("containers are nested more than {DEPTH_MAX} deep")]
    Nested,
}

/// One item of a payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct GpmfItem<'a> {
    /// Four characters.
    pub key: [u8; 4],
    /// Kind of the elements, 0 for a container.
    pub kind: u8,
    /// Bytes of one element.
    pub size: usize,
    /// All elements.
    pub data: &'a [u8],
}

/// The items of `bytes`, one after another; those without data are left out.
fn items(mut bytes: &[u8]) -> Result<Vec<GpmfItem<'_>>, GpmfError> {
    let mut out = Vec::new();
    while let Some(([k0, k1, k2, k3, kind, size, r0, r1], rest)) = bytes.split_first_chunk::<HEAD_BYTES>() {
        let (key, size) = ([*k0, *k1, *k2, *k3], usize::from(*size));
        let length = size * usize::from(u16::from_be_bytes([*r0, *r1]));
        let Some(data) = rest.get(..length) else {
            return Err(GpmfError::Overlong { key, bytes: length, left: rest.len() });
        };
        if length > 0 {
            out.push(GpmfItem { key, kind: *kind, size, data });
        }
        bytes = rest.get(length.next_multiple_of(4)..).unwrap_or(&[]);
    }
    Ok(out)
}

/// The innermost containers of a payload that begins with a device (`DEVC`), each as its items; none of anything else.
///
/// # Errors
/// Where an item is longer than what holds it, or containers are nested too deep.
pub(crate) fn streams(payload: &[u8]) -> Result<Vec<GpmfStream<'_>>, GpmfError> {
    let mut out = Vec::new();
    if payload.starts_with(b"DEVC") {
        collect(payload, 0, &mut out)?;
    }
    Ok(out)
}

fn collect<'a>(bytes: &'a [u8], depth: usize, out: &mut Vec<GpmfStream<'a>>) -> Result<(), GpmfError> {
    if depth > DEPTH_MAX {
        return Err(GpmfError::Nested);
    }
    let items = items(bytes)?;
    for container in items.iter().filter(|item| item.kind == 0) {
        collect(container.data, depth + 1, out)?;
    }
    if items.iter().all(|item| item.kind != 0) {
        out.push(GpmfStream(items));
    }
    Ok(())
}

/// The items of one stream.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct GpmfStream<'a>(Vec<GpmfItem<'a>>);

/// Share of a payload that belongs to one sensor.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct SensorBlock {
    /// In SI units; axes in the camera's order where it says how the sensor is turned.
    pub values: Vec<DVec3>,
    /// The camera's clock at the first sample, milliseconds.
    pub stamp_ms: Option<f64>,
    /// Samples since the camera began, up to and with this payload.
    pub total: Option<u32>,
}

impl<'a> GpmfStream<'a> {
    /// Key of the stream's data, which is the last item.
    pub(crate) fn key(&self) -> Option<[u8; 4]> {
        self.0.last().map(|item| item.key)
    }

    /// The last item of a key.
    fn item(&self, key: &[u8; 4]) -> Option<&GpmfItem<'a>> {
        self.0.iter().rev().find(|item| item.key == *key)
    }

    /// The only element of an item, where it is of that kind and has `N` bytes.
    fn single<const N: usize>(&self, key: &[u8; 4], kind: u8) -> Option<[u8; N]> {
        self.item(key).filter(|item| item.kind == kind).and_then(|item| item.data.try_into().ok())
    }

    /// Text of an item, which is in ISO 8859-1.
    pub(crate) fn text(&self, key: &[u8; 4]) -> Option<String> {
        let item = self.item(key).filter(|i| i.kind == b'c' && (i.size == 1 || i.size == i.data.len()))?;
        let text: String = item.data.iter().map(|c| char::from(*c)).collect();
        Some(text.trim_end_matches('\0').to_owned())
    }

    /// Samples of three 16-bit numbers in SI units. `model` is the camera's, whose first ones do not say how their sensors are turned.
    ///
    /// # Errors
    /// The reason why the samples cannot be used, to follow "its GYRO block".
    pub(crate) fn sensor(&self, model: &str) -> Result<SensorBlock, String> {
        let Some(data) = self.0.last() else { return Ok(SensorBlock::default()) };
        if data.kind != b's' || data.size != 6 {
            return Err("is not made of three 16-bit numbers a sample".to_owned());
        }
        let scale = self.scale();
        if !(scale.is_finite() && scale != 0.0) {
            return Err("has no usable scale".to_owned());
        }
        let to_si = match self.text(b"SIUN").or_else(|| self.text(b"UNIT")).unwrap_or_default().as_str() {
            "" | "rad/s" | "m/s\u{b2}" | "m/s2" => 1.0,
            "deg/s" | "\u{b0}/s" => 1.0_f64.to_radians(),
            "g" => 9.80665,
            other => return Err(format!("is in {other:?}, not in rad/s or m/s\u{b2}")),
        };
        let axes = self.axes(model).ok_or("says in no usable way how it is turned")?;
        let number = |bytes: [u8; 2]| f64::from(i16::from_be_bytes(bytes)) / scale * to_si;
        let sample = |[x0, x1, y0, y1, z0, z1]: &[u8; 6]| {
            let raw = [number([*x0, *x1]), number([*y0, *y1]), number([*z0, *z1])];
            DVec3::from_array(axes.map(|(axis, sign)| sign * raw.get(axis).copied().unwrap_or(f64::NAN)))
        };
        Ok(SensorBlock {
            values: data.data.as_chunks::<6>().0.iter().map(sample).collect(),
            stamp_ms: self.stamp_ms(),
            total: self.single(b"TSMP", b'L').map(u32::from_be_bytes),
        })
    }

    /// Divisor of the raw numbers; 1 without one, NaN for one of an unknown kind.
    fn scale(&self) -> f64 {
        let whole = || self.single(b"SCAL", b's').map(|b| f64::from(i16::from_be_bytes(b)));
        let real = || self.single(b"SCAL", b'f').map(|b| f64::from(f32::from_be_bytes(b)));
        if self.item(b"SCAL").is_none() { 1.0 } else { whole().or_else(real).unwrap_or(f64::NAN) }
    }

    /// The camera's clock: microseconds (`STMP`), or milliseconds (`TICK`, HERO5).
    fn stamp_ms(&self) -> Option<f64> {
        let micros = self.single(b"STMP", b'J').map(|b| u64::from_be_bytes(b) as f64 / 1000.0);
        micros.or_else(|| self.single(b"TICK", b'L').map(|b| f64::from(u32::from_be_bytes(b))))
    }

    /// For each axis the channel that it comes from and its sign: by the matrix (`MTRX`), by the names of the channels before and after
    /// (`ORIN`, `ORIO`), or by the model. `None` where one is given that makes no sense.
    fn axes(&self, model: &str) -> Option<[(usize, f64); 3]> {
        let by_matrix = |matrix: [[f64; 3]; 3]| {
            let mut out = [(0, 1.0); 3];
            for (axis, row) in out.iter_mut().zip(matrix) {
                let (channel, weight) = row.into_iter().enumerate().find(|(_, w)| w.abs() > 0.5)?;
                *axis = (channel, weight.signum());
            }
            Some(out)
        };
        let by_names = |from: &[u8], to: &[u8]| {
            let row = |o: u8| {
                let weight = |i: &u8| match i {
                    i if *i == o => 1.0,
                    i if i.eq_ignore_ascii_case(&o) => -1.0,
                    _ => 0.0,
                };
                let weights: Vec<f64> = from.iter().map(weight).collect();
                <[f64; 3]>::try_from(weights).ok()
            };
            let [a, b, c] = to else { return None };
            by_matrix([row(*a)?, row(*b)?, row(*c)?])
        };
        if let Some(matrix) = self.item(b"MTRX").filter(|i| i.kind == b'f' && i.size == 36) {
            let (numbers, _) = matrix.data.as_chunks::<4>();
            let number = |i: usize| numbers.get(i).map_or(0.0, |b| f64::from(f32::from_be_bytes(*b)));
            return by_matrix([0, 3, 6].map(|row| [number(row), number(row + 1), number(row + 2)]));
        }
        if let (Some(from), Some(to)) = (self.text(b"ORIN"), self.text(b"ORIO")) {
            return by_names(from.as_bytes(), to.as_bytes());
        }
        let order: &[u8] = match model {
            m if m.contains("HERO6") => b"ZyX",
            m if m.contains("HERO7 Silver") => b"YXz",
            _ => b"XYZ",
        };
        by_names(b"XYZ", order)
    }
}

/// The camera's model as it stands in the file outside its tracks: in a box of GPMF items (`MINF`), or in the text that older cameras put
/// before the pictures. `ends` are the file's first and last bytes.
pub(crate) fn camera_model(ends: &[u8]) -> Option<String> {
    boxed_model(ends).or_else(|| {
        let text = ends.get(find(ends, b"GPRO")?..)?;
        let text = text.get(..text.len().min(1024))?;
        let name = text.get(find(text, b"HERO")?..)?;
        Some(String::from_utf8_lossy(name.split(|c| *c == 0).next()?).into_owned())
    })
}

fn boxed_model(ends: &[u8]) -> Option<String> {
    let at = find(ends, b"GPMFDEVC")?.checked_sub(4)?;
    let bytes: [u8; 4] = ends.get(at..at + 4)?.try_into().ok()?;
    let end = at.checked_add(usize::try_from(u32::from_be_bytes(bytes)).ok()?)?;
    let payload = ends.get(at + 8..end)?;
    streams(payload).ok()?.iter().find_map(|stream| stream.text(b"MINF"))
}

fn find(bytes: &[u8], what: &[u8]) -> Option<usize> {
    bytes.windows(what.len()).position(|window| window == what)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn item(key: &[u8; 4], kind: u8, size: u8, data: &[u8]) -> Vec<u8> {
        let mut out = [&key[..], &[kind, size]].concat();
        out.extend(((data.len() / usize::from(size)) as u16).to_be_bytes());
        out.extend(data);
        out.resize(out.len().next_multiple_of(4), 0);
        out
    }

    fn numbers(all: &[i16]) -> Vec<u8> {
        all.iter().flat_map(|n| n.to_be_bytes()).collect()
    }

    /// Two streams: a gyro that says all that can be said, and one that says nothing.
    fn payload(extra: &[u8]) -> Vec<u8> {
        let gyro = [
            item(b"TSMP", b'L', 4, &400u32.to_be_bytes()),
            item(b"STMP", b'J', 8, &1_500_250u64.to_be_bytes()),
            item(b"SIUN", b'c', 1, b"deg/s"),
            item(b"SCAL", b's', 2, &numbers(&[100])),
            extra.to_vec(),
            item(b"GYRO", b's', 6, &numbers(&[100, -200, 300, 4, 5, 6])),
        ]
        .concat();
        let accel = item(b"ACCL", b's', 6, &numbers(&[1, 2, 3]));
        item(b"DEVC", 0, 1, &[item(b"STRM", 0, 1, &gyro), item(b"STRM", 0, 1, &accel)].concat())
    }

    fn gyro(extra: &[u8], model: &str) -> Result<SensorBlock, String> {
        let payload = payload(extra);
        let streams = streams(&payload).unwrap();
        streams.iter().find(|s| s.key() == Some(*b"GYRO")).unwrap().sensor(model)
    }

    #[test]
    fn a_stream_is_read_with_unit_scale_clock_and_count() {
        let block = gyro(&[], "").unwrap();
        assert!(block.values[0].abs_diff_eq(DVec3::new(1.0, -2.0, 3.0).map(f64::to_radians), 1e-15));
        assert_eq!((block.values.len(), block.stamp_ms, block.total), (2, Some(1500.25), Some(400)));
        let payload = payload(&[]);
        let all = streams(&payload).unwrap();
        let plain = all[1].sensor("").unwrap();
        assert_eq!((all.len(), all[1].key()), (2, Some(*b"ACCL")));
        let expected = SensorBlock { values: vec![DVec3::new(1.0, 2.0, 3.0)], ..SensorBlock::default() };
        assert_eq!(plain, expected);
    }

    #[test]
    fn axes_follow_the_matrix_the_names_or_the_model() {
        let turned = |extra: &[u8], model| {
            let first = gyro(extra, model).unwrap().values[0];
            first.to_array().map(|v| v.to_degrees().round())
        };
        assert_eq!(turned(&[], "HERO5 Black"), [1.0, -2.0, 3.0]);
        assert_eq!(turned(&[], "HERO6 Black"), [3.0, 2.0, 1.0]);
        assert_eq!(turned(&[], "HERO7 Silver"), [-2.0, 1.0, -3.0]);
        let names = [item(b"ORIN", b'c', 1, b"YxZ"), item(b"ORIO", b'c', 1, b"ZXY")].concat();
        assert_eq!(turned(&names, "HERO6 Black"), [3.0, 2.0, 1.0]);
        let rows = [0.0f32, 0.0, -1.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let matrix: Vec<u8> = rows.iter().flat_map(|v| v.to_be_bytes()).collect();
        assert_eq!(turned(&[names, item(b"MTRX", b'f', 36, &matrix)].concat(), ""), [-3.0, 1.0, -2.0]);
        let empty = item(b"MTRX", b'f', 36, &[0; 36]);
        assert!(gyro(&empty, "").unwrap_err().contains("turned"));
    }

    #[test]
    fn the_model_stands_in_a_box_or_in_the_text_before_the_pictures() {
        let inner = item(b"DEVC", 0, 1, &item(b"MINF", b'c', 1, b"HERO9 Black"));
        let boxed = [&(inner.len() as u32 + 8).to_be_bytes()[..], b"GPMF", &inner].concat();
        assert_eq!(camera_model(&[b"moov", &boxed[..]].concat()).as_deref(), Some("HERO9 Black"));
        assert_eq!(camera_model(b"..GPRO..HERO5 Black\0..").as_deref(), Some("HERO5 Black"));
        assert_eq!(camera_model(b"HERO5 Black\0"), None);
        for cut in 0..boxed.len() {
            assert_eq!(camera_model(&boxed[..cut]), None, "{cut}");
        }
    }

    #[test]
    fn nesting_without_end_and_overlong_items_are_refused() {
        let deep = (0..DEPTH_MAX + 2).fold(Vec::new(), |inner, _| {
            item(b"DEVC", 0, 1, if inner.is_empty() { b"abcd" } else { &inner })
        });
        assert_eq!(streams(&deep), Err(GpmfError::Nested));
        let mut long = payload(&[]);
        long.truncate(40);
        assert!(matches!(streams(&long), Err(GpmfError::Overlong { key: [b'D', b'E', b'V', b'C'], .. })));
        assert_eq!(streams(b"GARBAGE!"), Ok(Vec::new()));
    }

    proptest! {
        #[test]
        fn hostile_bytes_never_panic(
            changes in proptest::collection::vec((any::<proptest::sample::Index>(), any::<u8>()), 0..40),
            cut in any::<proptest::sample::Index>(), noise in proptest::collection::vec(any::<u8>(), 0..200),
        ) {
            let mut bytes = payload(&item(b"MTRX", b'f', 36, &[63; 36]));
            for (at, byte) in changes {
                let at = at.index(bytes.len());
                bytes[at] = byte;
            }
            bytes.truncate(cut.index(bytes.len()) + 1);
            for bytes in [&bytes, &noise, &[b"DEVC", &noise[..]].concat()] {
                for stream in streams(bytes).unwrap_or_default() {
                    let _ = (stream.sensor("HERO6"), stream.text(b"SIUN"));
                }
                let _ = camera_model(bytes);
            }
        }
    }
}
