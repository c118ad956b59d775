//! A glTF document with its buffers in memory, everything bounded.

use std::{
    io::Read,
    path::{Component, Path, PathBuf},
};

use base64::{Engine, engine::general_purpose::STANDARD};
use bowwave_files::plain_file;
use gltf::{
    Document,
    json::{self, mesh::Semantic, validation::Checked},
};
use percent_encoding::percent_decode_str;

use super::FILE_BYTES_MAX;
use crate::error::ModelError;

/// A document and the bytes that it refers to.
pub(crate) struct ModelSource<'a> {
    /// Name in errors.
    pub(crate) file: &'a str,
    /// The validated document.
    pub(crate) document: Document,
    /// Bytes of each buffer.
    buffers: Vec<Vec<u8>>,
    folder: Option<&'a Path>,
}

impl<'a> ModelSource<'a> {
    /// Parses `bytes` and reads all buffers.
    pub(crate) fn open(bytes: &[u8], file: &'a str, folder: Option<&'a Path>) -> Result<Self, ModelError> {
        limit(file, "the file's size in bytes", bytes.len() as u64, FILE_BYTES_MAX)?;
        let (root, blob) = parse(bytes).map_err(|problem| gltf_error(file, problem))?;
        let document = Document::from_json(root).map_err(|e| gltf_error(file, explain(&e)))?;
        let mut source = Self { file, document, buffers: Vec::new(), folder };
        source.read_buffers(blob)?;
        Ok(source)
    }

    /// The document's JSON.
    pub(crate) fn root(&self) -> &json::Root {
        self.document.as_json()
    }

    /// An error about this file.
    pub(crate) fn error(&self, problem: impl Into<String>) -> ModelError {
        gltf_error(self.file, problem)
    }

    /// The bytes of a buffer view.
    pub(crate) fn view(&self, index: usize) -> Result<&[u8], ModelError> {
        let missing = || self.error(format!("buffer view {index} lies outside its buffer"));
        let view = self.root().buffer_views.get(index).ok_or_else(missing)?;
        let start = usize::try_from(view.byte_offset.unwrap_or_default().0).map_err(|_| missing())?;
        let length = usize::try_from(view.byte_length.0).map_err(|_| missing())?;
        let end = start.checked_add(length).ok_or_else(missing)?;
        self.buffers.get(view.buffer.value()).and_then(|b| b.get(start..end)).ok_or_else(missing)
    }

    /// The bytes that a URI stands for: embedded, or a file in the document's folder or below.
    pub(crate) fn fetch(&self, uri: &str) -> Result<Vec<u8>, ModelError> {
        if let Some(data) = uri.strip_prefix("data:") {
            let (_, payload) = data
                .split_once(";base64,")
                .ok_or_else(|| self.error("an embedded data URI is not base64"))?;
            return STANDARD
                .decode(payload)
                .map_err(|e| self.error(format!("an embedded data URI is not base64: {e}")));
        }
        read_bounded(&self.beside(uri)?)
    }

    /// The path of a relative URI. The folder is not left: a model is no way to read other files.
    fn beside(&self, uri: &str) -> Result<PathBuf, ModelError> {
        let shown: String = uri.chars().take(80).collect();
        let Some(folder) = self.folder else {
            return Err(
                self.error(format!("it refers to the file {shown:?}, but must hold everything itself"))
            );
        };
        let decoded = percent_decode_str(uri).decode_utf8_lossy().into_owned();
        let path = Path::new(&decoded);
        let stays = path.components().all(|c| matches!(c, Component::Normal(_) | Component::CurDir));
        if !stays || decoded.contains("://") || decoded.is_empty() {
            return Err(
                self.error(format!("it refers to {shown:?}; only files in its own folder or below are read"))
            );
        }
        Ok(folder.join(path))
    }

    fn read_buffers(&mut self, mut blob: Option<Vec<u8>>) -> Result<(), ModelError> {
        let stated: Vec<(Option<String>, u64)> =
            self.root().buffers.iter().map(|b| (b.uri.clone(), b.byte_length.0)).collect();
        let mut total = 0;
        for (i, (uri, length)) in stated.into_iter().enumerate() {
            let bytes = match uri {
                Some(uri) => self.fetch(&uri)?,
                None if i == 0 => {
                    blob.take().ok_or_else(|| self.error("buffer 0 has neither a URI nor a binary chunk"))?
                }
                None => return Err(self.error(format!("buffer {i} has no URI"))),
            };
            if (bytes.len() as u64) < length {
                let got = bytes.len();
                return Err(
                    self.error(format!("buffer {i} should have {length} bytes but has {got}: truncated?"))
                );
            }
            total += bytes.len() as u64;
            limit(self.file, "the sum of its buffers in bytes", total, FILE_BYTES_MAX)?;
            self.buffers.push(bytes);
        }
        Ok(())
    }
}

/// `Err` where `value` is more than `most`.
pub(crate) fn limit(file: &str, what: &'static str, value: u64, most: u64) -> Result<(), ModelError> {
    if value <= most {
        return Ok(());
    }
    Err(ModelError::TooLarge { file: file.to_owned(), what, value, limit: most })
}

/// Reads a plain file of at most [`FILE_BYTES_MAX`] bytes.
pub(crate) fn read_bounded(path: &Path) -> Result<Vec<u8>, ModelError> {
    let file = path.display().to_string();
    let read = |source| ModelError::Read { file: file.clone(), source };
    let handle = plain_file(path).map_err(read)?;
    let meta = handle.metadata().map_err(read)?;
    limit(&file, "the file's size in bytes", meta.len(), FILE_BYTES_MAX)?;
    let mut bytes = Vec::with_capacity(meta.len() as usize);
    handle.take(FILE_BYTES_MAX + 1).read_to_end(&mut bytes).map_err(read)?;
    limit(&file, "the file's size in bytes", bytes.len() as u64, FILE_BYTES_MAX)?;
    Ok(bytes)
}

fn gltf_error(file: &str, problem: impl Into<String>) -> ModelError {
    ModelError::Gltf { file: file.to_owned(), problem: problem.into() }
}

/// Parses the container and checks what the library's own validation takes for granted: a header length that is not
/// shorter than the header, and position accessors that exist.
fn parse(bytes: &[u8]) -> Result<(json::Root, Option<Vec<u8>>), String> {
    let (json, blob) = if bytes.starts_with(b"glTF") {
        match bytes.get(8..12).and_then(|b| <[u8; 4]>::try_from(b).ok()).map(u32::from_le_bytes) {
            Some(length) if length as usize >= 20 && length as usize <= bytes.len() => {}
            _ => return Err("the header's length does not fit the file: truncated?".to_owned()),
        }
        let glb = gltf::Glb::from_slice(bytes).map_err(|e| explain(&e))?;
        (glb.json.into_owned(), glb.bin.map(std::borrow::Cow::into_owned))
    } else {
        (bytes.to_vec(), None)
    };
    let root = json::Root::from_slice(&json).map_err(|e| format!("{e} of its JSON"))?;
    for (m, mesh) in root.meshes.iter().enumerate() {
        for primitive in &mesh.primitives {
            let position = primitive.attributes.get(&Checked::Valid(Semantic::Positions));
            if position.is_some_and(|i| i.value() >= root.accessors.len()) {
                return Err(format!("mesh {m} has positions in an accessor that is not there"));
            }
        }
    }
    Ok((root, blob))
}

/// One line on a library error: of many validation errors the first.
fn explain(error: &gltf::Error) -> String {
    match error {
        gltf::Error::Validation(all) => match all.as_slice() {
            [] => "it is invalid".to_owned(),
            [(path, e)] => format!("{path}: {e}"),
            [(path, e), rest @ ..] => format!("{path}: {e} (and {} more problems)", rest.len()),
        },
        other => other.to_string(),
    }
}
