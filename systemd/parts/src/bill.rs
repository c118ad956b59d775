//! The bill of materials, in CycloneDX 1.5.

use anyhow::{Context, Result};
use serde_json::{Value, json};

use crate::crate_graph::LinkedCrate;

/// The bill of a program whose own crate goes first in `crates`. The same crates give the same bytes.
pub fn json(crates: &[LinkedCrate]) -> Result<String> {
    let (program, others) = crates.split_first().context("a program without a crate")?;
    let bill = json!({
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": { "component": component(program, "application") },
        "components": others.iter().map(|c| component(c, "library")).collect::<Vec<_>>(),
        "dependencies": crates.iter().map(|c| json!({ "ref": c.purl(), "dependsOn": c.uses })).collect::<Vec<_>>(),
    });
    Ok(serde_json::to_string_pretty(&bill).context("the bill of materials is no JSON")? + "\n")
}

fn component(part: &LinkedCrate, kind: &str) -> Value {
    let mut component = json!({
        "type": kind,
        "bom-ref": part.purl(),
        "name": part.name,
        "version": part.version,
        "purl": part.purl(),
        "licenses": [{ "expression": part.licence }],
    });
    if let Some(checksum) = &part.checksum {
        component["hashes"] = json!([{ "alg": "SHA-256", "content": checksum }]);
    }
    if let Some(repository) = &part.repository {
        component["externalReferences"] = json!([{ "type": "vcs", "url": repository }]);
    }
    component
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::{crate_graph, workspace};

    #[test]
    fn the_bill_of_this_program_is_closed() {
        let crates = crate_graph::of_program(&workspace()).unwrap();
        let bill: Value = serde_json::from_str(&json(&crates).unwrap()).unwrap();
        assert_eq!(bill["metadata"]["component"]["name"], "bowwave");
        let components = bill["components"].as_array().unwrap();
        let named: BTreeSet<&str> = components.iter().map(|c| c["bom-ref"].as_str().unwrap()).collect();
        assert_eq!(named.len(), components.len(), "a component stands twice");
        assert!(components.iter().any(|c| c["name"] == "ash" && c["hashes"][0]["content"].is_string()));
        // Every crate that another uses is a component itself.
        for dependency in bill["dependencies"].as_array().unwrap() {
            for used in dependency["dependsOn"].as_array().unwrap() {
                assert!(named.contains(used.as_str().unwrap()), "{used} is no component");
            }
        }
    }
}
