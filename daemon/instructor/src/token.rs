//! Tokens of instructors: made once, kept as hashes.
//!
//! A token has 256 random bits. Nobody can try all of them, so that a plain SHA-256 keeps them: the slow hashes that passwords need would
//! protect nothing here, and would let anybody keep the computer busy with wrong tokens.

use std::{
    fs::{self, File, Permissions},
    io::{self, Write as _},
    os::unix::fs::{MetadataExt as _, PermissionsExt as _, fchown},
    path::{Path, PathBuf},
};

use base64::{Engine as _, engine::general_purpose::URL_SAFE_NO_PAD};
use rand::{TryRng as _, rngs::SysRng};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};
use subtle::{Choice, ConditionallySelectable as _, ConstantTimeEq as _};

/// Most tokens of a file.
pub const TOKENS_MAX: usize = 64;
/// Most bytes of a token's name.
pub const TOKEN_NAME_BYTES_MAX: usize = 40;
/// Begins every token, so that one that was left somewhere is recognised.
pub const TOKEN_PREFIX: &str = "bowwave_";
/// Most bytes of the file: 64 lines have a quarter of it.
const FILE_BYTES_MAX: usize = 64 << 10;

/// A failure with the file of tokens.
#[derive(Debug, thiserror::Error)]
pub enum TokenError {
    /// The file cannot be read or written.
    #[error("tokens in {}: {error}; check the path and who may read and write there", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// A line is none of a token.
    #[error("tokens in {}, line {line}: {error}; take the line out, or revoke its token and add another", path.display())]
    Line {
        /// The file.
        path: PathBuf,
        /// From 1.
        line: usize,
        /// Why.
        error: String,
    },
    /// A name that no token can have.
    #[error(
        "{0:?} is no name of a token: give 1 to {TOKEN_NAME_BYTES_MAX} letters, digits, spaces, dots, dashes and underscores"
    )]
    Name(String),
    /// There is one of that name.
    #[error("there is a token {0:?}: revoke it first, or give another name")]
    Taken(String),
    /// There is none of that name.
    #[error("there is no token {name:?}: {}", if known.is_empty() { "there are none at all".to_owned() } else { format!("there are {}", known.join(", ")) })]
    Unknown {
        /// The name that was given.
        name: String,
        /// Names that there are.
        known: Vec<String>,
    },
    /// There are as many as a file holds.
    #[error("there are {TOKENS_MAX} tokens, the most that there can be: revoke one first")]
    Full,
    /// The system gave no random bytes.
    #[error("the system gives no random bytes: {0}")]
    Random(String),
}

/// A token as the file has it.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TokenEntry {
    /// Its name, which everybody at the page is shown.
    pub name: String,
    /// When it was made, UTC.
    pub made: String,
    /// SHA-256 of the token, hexadecimal.
    sha256: String,
}

/// A token that is let in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct KnownToken {
    pub(crate) name: String,
    pub(crate) hash: [u8; 32],
}

/// The file of tokens: one line of JSON each, with name, date and hash.
#[derive(Clone, Debug)]
pub struct TokenFile {
    path: PathBuf,
}

impl TokenFile {
    /// The file at `path`. It need not be there.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self { path: path.into() }
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Makes a token of that name. It is shown this once: the file has its hash alone.
    ///
    /// # Errors
    /// Where the name is none or taken, or the file cannot be read or written.
    pub fn add(&self, name: &str) -> Result<String, TokenError> {
        if !is_name(name) {
            return Err(TokenError::Name(name.to_owned()));
        }
        let _lock = self.lock()?;
        let mut entries = self.list()?;
        if entries.iter().any(|entry| entry.name == name) {
            return Err(TokenError::Taken(name.to_owned()));
        }
        if entries.len() >= TOKENS_MAX {
            return Err(TokenError::Full);
        }
        let token = format!("{TOKEN_PREFIX}{}", random_text()?);
        let now = jiff::Timestamp::from_second(jiff::Timestamp::now().as_second()).unwrap_or_default();
        entries.push(TokenEntry { name: name.to_owned(), made: now.to_string(), sha256: hex(&hash(&token)) });
        self.write(&entries)?;
        Ok(token)
    }

    /// All tokens in the order in which they were made; none where there is no file.
    ///
    /// # Errors
    /// Where the file cannot be read, or a line is none of a token.
    pub fn list(&self) -> Result<Vec<TokenEntry>, TokenError> {
        let text = match bowwave_files::plain_text(&self.path, FILE_BYTES_MAX) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
            Err(error) => return Err(self.io(error)),
        };
        let mut entries = Vec::new();
        for (i, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
            let wrong = |error: String| TokenError::Line { path: self.path.clone(), line: i + 1, error };
            let entry: TokenEntry = serde_json::from_str(line).map_err(|e| wrong(e.to_string()))?;
            if !is_name(&entry.name) {
                return Err(wrong(TokenError::Name(entry.name).to_string()));
            }
            if unhex(&entry.sha256).is_none() {
                return Err(wrong("sha256 is no 64 hexadecimal digits".to_owned()));
            }
            if entries.len() >= TOKENS_MAX {
                return Err(wrong(TokenError::Full.to_string()));
            }
            entries.push(entry);
        }
        Ok(entries)
    }

    /// Takes a token out. Sessions that were begun with it end within a second.
    ///
    /// # Errors
    /// Where there is none of that name, or the file cannot be read or written.
    pub fn revoke(&self, name: &str) -> Result<(), TokenError> {
        let _lock = self.lock()?;
        let mut entries = self.list()?;
        let before = entries.len();
        entries.retain(|entry| entry.name != name);
        if entries.len() == before {
            let known = entries.into_iter().map(|entry| entry.name).collect();
            return Err(TokenError::Unknown { name: name.to_owned(), known });
        }
        self.write(&entries)
    }

    /// A warning where others than owner and group may read or write the file.
    pub fn warning(&self) -> Option<String> {
        let mode = fs::metadata(&self.path).ok()?.mode() & 0o777;
        (mode & 0o007 != 0).then(|| {
            let path = self.path.display();
            format!(
                "everybody on this computer may touch the tokens in {path} (mode {mode:o}): chmod 0640 {path}"
            )
        })
    }

    /// The tokens that are let in.
    pub(crate) fn known(&self) -> Result<Vec<KnownToken>, TokenError> {
        let known = |entry: TokenEntry| Some(KnownToken { hash: unhex(&entry.sha256)?, name: entry.name });
        Ok(self.list()?.into_iter().filter_map(known).collect())
    }

    fn io(&self, error: io::Error) -> TokenError {
        TokenError::Io { path: self.path.clone(), error }
    }

    fn folder(&self) -> &Path {
        self.path.parent().filter(|parent| !parent.as_os_str().is_empty()).unwrap_or(Path::new("."))
    }

    /// Keeps others that add or revoke away, until it is dropped.
    fn lock(&self) -> Result<File, TokenError> {
        let folder = File::open(self.folder()).map_err(|e| self.io(e))?;
        folder.lock().map_err(|e| self.io(e))?;
        Ok(folder)
    }

    /// Writes all of the file at once, with owner and group of the one before; those of the folder where there was none.
    fn write(&self, entries: &[TokenEntry]) -> Result<(), TokenError> {
        let write = || -> io::Result<()> {
            let mut file = tempfile::NamedTempFile::new_in(self.folder())?;
            for entry in entries {
                writeln!(file, "{}", serde_json::to_string(entry)?)?;
            }
            file.as_file().set_permissions(Permissions::from_mode(0o640))?;
            let like = fs::metadata(&self.path).or_else(|_| fs::metadata(self.folder()))?;
            let own = file.as_file().metadata()?;
            if (own.uid(), own.gid()) != (like.uid(), like.gid()) {
                // Only root may give files away; for others the file stays their own.
                if let Err(error) = fchown(file.as_file(), Some(like.uid()), Some(like.gid())) {
                    log::debug!("owner of {}: {error}", self.path.display());
                }
            }
            file.as_file().sync_all()?;
            file.persist(&self.path).map_err(|e| e.error)?;
            File::open(self.folder())?.sync_all()
        };
        write().map_err(|e| self.io(e))
    }
}

/// Tests whether a token can have that name.
fn is_name(name: &str) -> bool {
    let is_plain = |c: char| c.is_alphanumeric() || " ._-".contains(c);
    !name.trim().is_empty()
        && name.trim() == name
        && name.len() <= TOKEN_NAME_BYTES_MAX
        && name.chars().all(is_plain)
}

/// The token of that hash, compared with each one in a time that says nothing of how alike they are.
pub(crate) fn find<'a>(known: &'a [KnownToken], hash: &[u8; 32]) -> Option<&'a KnownToken> {
    let mut found = u64::MAX;
    for (at, token) in (0u64..).zip(known) {
        let same: Choice = token.hash.ct_eq(hash);
        found.conditional_assign(&at, same);
    }
    known.get(usize::try_from(found).ok()?)
}

/// 256 random bits as text.
pub(crate) fn random_text() -> Result<String, TokenError> {
    let mut bytes = [0; 32];
    SysRng.try_fill_bytes(&mut bytes).map_err(|e| TokenError::Random(e.to_string()))?;
    Ok(URL_SAFE_NO_PAD.encode(bytes))
}

/// SHA-256 of a text.
pub(crate) fn hash(text: &str) -> [u8; 32] {
    Sha256::digest(text.as_bytes()).into()
}

fn hex(bytes: &[u8; 32]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

fn unhex(text: &str) -> Option<[u8; 32]> {
    let digits: &[u8; 64] = text.as_bytes().try_into().ok()?;
    let mut bytes = [0; 32];
    for (byte, pair) in bytes.iter_mut().zip(digits.chunks_exact(2)) {
        let [high, low] = pair else { return None };
        let digit = |c: &u8| char::from(*c).to_digit(16);
        *byte = u8::try_from(digit(high)? * 16 + digit(low)?).ok()?;
    }
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn tokens_are_added_listed_and_revoked() {
        let folder = tempfile::tempdir().unwrap();
        let file = TokenFile::new(folder.path().join("tokens"));
        assert!(file.list().unwrap().is_empty() && file.warning().is_none());
        let (anna, boris) = (file.add("Anna").unwrap(), file.add("b.oris-2").unwrap());
        assert!(anna.starts_with(TOKEN_PREFIX) && anna.len() == TOKEN_PREFIX.len() + 43 && anna != boris);
        let text = fs::read_to_string(file.path()).unwrap();
        assert!(
            !text.contains(&anna) && !text.contains(&anna[TOKEN_PREFIX.len()..]),
            "the file has no token"
        );
        let names: Vec<String> = file.list().unwrap().into_iter().map(|entry| entry.name).collect();
        assert_eq!(names, ["Anna", "b.oris-2"]);
        let known = file.known().unwrap();
        assert_eq!(find(&known, &hash(&boris)).unwrap().name, "b.oris-2");
        assert_eq!(find(&known, &hash("bowwave_x")), None);
        assert!(matches!(file.add("Anna"), Err(TokenError::Taken(_))));
        file.revoke("Anna").unwrap();
        assert_eq!(find(&file.known().unwrap(), &hash(&anna)), None);
        let error = file.revoke("Anna").unwrap_err().to_string();
        assert!(error.contains("b.oris-2"), "{error}");
        assert_eq!(fs::metadata(file.path()).unwrap().mode() & 0o777, 0o640);
        fs::set_permissions(file.path(), Permissions::from_mode(0o644)).unwrap();
        assert!(file.warning().unwrap().contains("chmod 0640"));
    }

    #[test]
    fn names_that_are_none_are_refused() {
        let folder = tempfile::tempdir().unwrap();
        let file = TokenFile::new(folder.path().join("tokens"));
        for name in ["", " ", " a", "a\nb", "a\"b", "<b>", &"x".repeat(TOKEN_NAME_BYTES_MAX + 1)] {
            assert!(matches!(file.add(name), Err(TokenError::Name(_))), "{name:?}");
        }
    }

    #[test]
    fn a_file_that_is_none_is_refused_with_its_line() {
        let folder = tempfile::tempdir().unwrap();
        let file = TokenFile::new(folder.path().join("tokens"));
        file.add("a").unwrap();
        let text = fs::read_to_string(file.path()).unwrap();
        let short = text.replace("\"sha256\":\"", "\"sha256\":\"g");
        for (wrong, line) in [("{}", 2), ("no JSON", 2), (short.as_str(), 2)] {
            fs::write(file.path(), format!("{text}{wrong}\n")).unwrap();
            let error = file.list().unwrap_err();
            assert!(matches!(error, TokenError::Line { line: l, .. } if l == line), "{error}");
        }
    }

    proptest! {
        #[test]
        fn hashes_come_back_from_their_digits(bytes: [u8; 32]) {
            prop_assert_eq!(unhex(&hex(&bytes)), Some(bytes));
        }

        #[test]
        fn digits_that_are_none_are_no_hash(text in ".{0,80}") {
            prop_assume!(text.len() != 64 || !text.chars().all(|c| c.is_ascii_hexdigit()));
            prop_assert_eq!(unhex(&text), None);
        }

        #[test]
        fn any_file_is_read_or_refused(text in ".{0,200}") {
            let folder = tempfile::tempdir().unwrap();
            let file = TokenFile::new(folder.path().join("tokens"));
            fs::write(file.path(), text).unwrap();
            let _ = file.list();
        }
    }
}
