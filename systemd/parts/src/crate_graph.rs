//! The crates that the program is linked from, as `cargo metadata` resolves them.

use std::{
    collections::{BTreeMap, BTreeSet},
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use anyhow::{Context, Result, bail};
use serde::Deserialize;

/// The crate whose program is packaged.
const PROGRAM: &str = "bowwave";

/// A crate of the program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LinkedCrate {
    /// Name.
    pub name: String,
    /// Version.
    pub version: String,
    /// Licence, as an SPDX expression.
    pub licence: String,
    /// Authors, as its manifest names them.
    pub authors: Vec<String>,
    /// Address of its sources.
    pub repository: Option<String>,
    /// Folder of its sources on this computer.
    pub folder: PathBuf,
    /// SHA-256 of its archive; none of the project's own crates.
    pub checksum: Option<String>,
    /// Package URLs of the crates that it uses.
    pub uses: Vec<String>,
}

impl LinkedCrate {
    /// Package URL, which identifies a crate in a bill of materials.
    pub fn purl(&self) -> String {
        purl(&self.name, &self.version)
    }

    /// Whether it is the project's own.
    pub fn is_own(&self) -> bool {
        self.checksum.is_none()
    }
}

fn purl(name: &str, version: &str) -> String {
    format!("pkg:cargo/{name}@{version}")
}

/// The answer of `cargo metadata`, as far as it is needed.
#[derive(Deserialize)]
struct CargoMetadata {
    packages: Vec<CargoPackage>,
    resolve: CargoResolve,
}

#[derive(Deserialize)]
struct CargoPackage {
    id: String,
    name: String,
    version: String,
    license: Option<String>,
    #[serde(default)]
    authors: Vec<String>,
    repository: Option<String>,
    manifest_path: PathBuf,
    source: Option<String>,
}

#[derive(Deserialize)]
struct CargoResolve {
    nodes: Vec<CargoNode>,
}

#[derive(Deserialize)]
struct CargoNode {
    id: String,
    deps: Vec<CargoEdge>,
}

#[derive(Deserialize)]
struct CargoEdge {
    pkg: String,
    dep_kinds: Vec<CargoEdgeKind>,
}

#[derive(Deserialize)]
struct CargoEdgeKind {
    /// `None` of a normal dependency, else "dev" or "build".
    kind: Option<String>,
}

/// The crates of the program in the workspace at `root`, sorted by name; the program itself goes first.
pub fn of_program(root: &Path) -> Result<Vec<LinkedCrate>> {
    let target = format!("{}-unknown-linux-gnu", std::env::consts::ARCH);
    let out = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .args(["metadata", "--format-version", "1", "--locked", "--filter-platform", &target])
        .current_dir(root)
        .output()
        .context("cannot start cargo")?;
    if !out.status.success() {
        bail!("cargo metadata failed: {}", String::from_utf8_lossy(&out.stderr));
    }
    let metadata: CargoMetadata =
        serde_json::from_slice(&out.stdout).context("cargo metadata wrote no JSON")?;
    let lock = fs::read_to_string(root.join("Cargo.lock")).context("cannot read Cargo.lock")?;
    linked(&metadata, &checksums(&lock)?)
}

fn linked(
    metadata: &CargoMetadata,
    checksums: &BTreeMap<(String, String), String>,
) -> Result<Vec<LinkedCrate>> {
    let packages: BTreeMap<&str, &CargoPackage> =
        metadata.packages.iter().map(|p| (p.id.as_str(), p)).collect();
    let uses: BTreeMap<&str, Vec<&str>> =
        metadata.resolve.nodes.iter().map(|node| (node.id.as_str(), linked_edges(node))).collect();
    let program = packages.values().find(|p| p.name == PROGRAM).context("the workspace has no program")?;
    let mut reached = BTreeSet::new();
    let mut open = vec![program.id.as_str()];
    while let Some(id) = open.pop() {
        if reached.insert(id) {
            open.extend(uses.get(id).into_iter().flatten());
        }
    }
    let package =
        |id: &str| packages.get(id).copied().with_context(|| format!("cargo names no package {id}"));
    let mut crates = Vec::with_capacity(reached.len());
    for id in reached {
        let found = package(id)?;
        let used =
            uses.get(id).into_iter().flatten().map(|id| package(id).map(|p| purl(&p.name, &p.version)));
        crates.push(LinkedCrate {
            name: found.name.clone(),
            version: found.version.clone(),
            licence: expression(found)?,
            authors: found.authors.clone(),
            repository: found.repository.clone(),
            folder: found.manifest_path.parent().context("a manifest without a folder")?.to_path_buf(),
            checksum: match &found.source {
                None => None,
                Some(_) => Some(
                    checksums
                        .get(&(found.name.clone(), found.version.clone()))
                        .with_context(|| format!("Cargo.lock has no checksum of {}", found.name))?
                        .clone(),
                ),
            },
            uses: used.collect::<Result<_>>()?,
        });
    }
    crates.sort_by(|a, b| {
        (a.name != PROGRAM, &a.name, &a.version).cmp(&(b.name != PROGRAM, &b.name, &b.version))
    });
    Ok(crates)
}

/// Package ids of the crates that a crate is linked with; those that only its tests or its build use are left out.
fn linked_edges(node: &CargoNode) -> Vec<&str> {
    let linked = |edge: &&CargoEdge| edge.dep_kinds.iter().any(|k| k.kind.is_none());
    node.deps.iter().filter(linked).map(|edge| edge.pkg.as_str()).collect()
}

/// The licence in today's notation: older manifests separate alternatives by a slash.
fn expression(package: &CargoPackage) -> Result<String> {
    let written = package.license.as_deref().with_context(|| format!("{} names no licence", package.name))?;
    let alternatives: Vec<&str> = written.split('/').map(str::trim).collect();
    Ok(alternatives.join(" OR "))
}

/// SHA-256 of each crate's archive by name and version.
fn checksums(lock: &str) -> Result<BTreeMap<(String, String), String>> {
    #[derive(Deserialize)]
    struct LockFile {
        package: Vec<LockedPackage>,
    }
    #[derive(Deserialize)]
    struct LockedPackage {
        name: String,
        version: String,
        checksum: Option<String>,
    }
    let lock: LockFile = toml::from_str(lock).context("Cargo.lock cannot be read")?;
    Ok(lock.package.into_iter().filter_map(|p| Some(((p.name, p.version), p.checksum?))).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_linked_is_followed() {
        let package = |name: &str, license: &str, source: &str| {
            serde_json::json!({"id": name, "name": name, "version": "1.0.0", "license": license,
                "manifest_path": format!("/src/{name}/Cargo.toml"), "source": (!source.is_empty()).then_some(source)})
        };
        let edge =
            |name: &str, kind: Option<&str>| serde_json::json!({"pkg": name, "dep_kinds": [{"kind": kind}]});
        let metadata: CargoMetadata = serde_json::from_value(serde_json::json!({
            "packages": [package("bowwave", "MIT", ""), package("linked", "MIT/Apache-2.0", "r"),
                package("tester", "MIT", "r"), package("builder", "MIT", "r")],
            "resolve": {"nodes": [
                {"id": "bowwave", "deps": [edge("linked", None), edge("tester", Some("dev"))]},
                {"id": "linked", "deps": [edge("builder", Some("build"))]},
            ]},
        }))
        .unwrap();
        let lock = "[[package]]\nname = \"linked\"\nversion = \"1.0.0\"\nchecksum = \"ab\"\n";
        let found = linked(&metadata, &checksums(lock).unwrap()).unwrap();
        let names: Vec<&str> = found.iter().map(|c| c.name.as_str()).collect();
        assert_eq!(names, ["bowwave", "linked"]);
        assert_eq!(found[0].uses, ["pkg:cargo/linked@1.0.0"]);
        assert_eq!(found[1].licence, "MIT OR Apache-2.0");
        assert!(found[0].is_own() && !found[1].is_own());
        let error = linked(&metadata, &BTreeMap::new()).unwrap_err().to_string();
        assert!(error.contains("no checksum of linked"), "{error}");
    }
}
