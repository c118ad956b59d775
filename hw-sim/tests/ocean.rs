//! The ocean shares no code with the product.

use std::{fs, path::Path};

#[test]
fn the_ocean_uses_nothing_of_the_product() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/ocean");
    let mut files = 0;
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        for line in fs::read_to_string(&path).unwrap().lines() {
            let code = line.split("//").next().unwrap_or_default();
            assert!(!code.contains("bowwave_") && !code.contains("make::"), "{}: {line}", path.display());
        }
        files += 1;
    }
    assert!(files > 10, "only {files} files of the ocean were read");
}
