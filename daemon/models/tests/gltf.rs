//! A user's own glTF: what is read, what is refused and how, and that nothing panics.

#![allow(clippy::expect_used, reason = "a test helper, too, stops at the first thing that is wrong")]

use std::{fs, path::Path};

use base64::{Engine, engine::general_purpose::STANDARD};
use bowwave_core::model::{Model, ModelKind, Zone};
use bowwave_models::{Boat, ModelError, build_glb, load, load_glb, resolve};
use glam::{Vec2, Vec3};
use proptest::prelude::*;
use serde_json::{Value, json};

/// A box, counter-clockwise seen from outside, in glTF axes.
fn box_corners(min: [f32; 3], max: [f32; 3]) -> (Vec<[f32; 3]>, Vec<u32>) {
    let c = |i: usize| [0, 1, 2].map(|k| if i >> k & 1 == 0 { min[k] } else { max[k] });
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    let indices = faces.iter().flat_map(|&[a, b, c, d]| [a, b, c, a, c, d]).collect();
    ((0..8).map(c).collect(), indices)
}

/// glTF under construction: one buffer, a node and a mesh for each part.
struct GltfFile {
    json: Value,
    bin: Vec<u8>,
}

impl GltfFile {
    fn new() -> Self {
        let json = json!({
            "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}], "nodes": [], "meshes": [],
            "accessors": [], "bufferViews": [], "buffers": [], "materials": [], "textures": [], "images": [],
        });
        Self { json, bin: Vec::new() }
    }

    /// A boat of 8 m that passes every check: hull, engine aft, helm on top.
    fn boat() -> Self {
        let mut file = Self::new();
        file.part("hull", [-1.0, -0.5, -4.0], [1.0, 1.0, 4.0]);
        file.part("engine", [-0.3, -0.6, -4.5], [0.3, 1.2, -4.0]);
        file.part("helm", [-0.3, 1.0, -1.0], [0.3, 2.0, 0.0]);
        file
    }

    fn push(&mut self, list: &str, value: Value) -> usize {
        let all = self.json[list].as_array_mut().expect("a list");
        all.push(value);
        all.len() - 1
    }

    fn accessor(&mut self, bytes: Vec<u8>, component: u32, shape: &str, count: usize) -> usize {
        let view = json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()});
        self.bin.extend(bytes);
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let view = self.push("bufferViews", view);
        self.push(
            "accessors",
            json!({"bufferView": view, "componentType": component, "type": shape, "count": count}),
        )
    }

    fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let bytes = values.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let shape = ["SCALAR", "VEC2", "VEC3", "VEC4"][N - 1];
        let accessor = self.accessor(bytes, 5126, shape, values.len());
        if N == 3 {
            let fold = |f: fn(f32, f32) -> f32| {
                (0..3).map(|k| values.iter().map(|v| v[k]).reduce(f)).collect::<Vec<_>>()
            };
            self.json["accessors"][accessor]["min"] = json!(fold(f32::min));
            self.json["accessors"][accessor]["max"] = json!(fold(f32::max));
        }
        accessor
    }

    fn part(&mut self, name: &str, min: [f32; 3], max: [f32; 3]) -> usize {
        let (corners, indices) = box_corners(min, max);
        let position = self.floats(&corners);
        let bytes = indices.iter().flat_map(|i| (*i as u16).to_le_bytes()).collect();
        let indices = self.accessor(bytes, 5123, "SCALAR", indices.len());
        self.mesh(name, json!({"attributes": {"POSITION": position}, "indices": indices}))
    }

    fn mesh(&mut self, name: &str, primitive: Value) -> usize {
        let mesh = self.push("meshes", json!({"primitives": [primitive]}));
        let node = self.push("nodes", json!({"mesh": mesh, "name": name}));
        self.json["scenes"][0]["nodes"].as_array_mut().expect("a list").push(json!(node));
        node
    }

    fn primitive(&mut self, mesh: usize) -> &mut Value {
        &mut self.json["meshes"][mesh]["primitives"][0]
    }

    /// JSON with its buffer under `uri`; embedded where there is none.
    fn text(&self, uri: Option<&str>) -> Vec<u8> {
        let mut json = self.json.clone();
        let embedded = || format!("data:application/octet-stream;base64,{}", STANDARD.encode(&self.bin));
        let uri = uri.map_or_else(embedded, str::to_owned);
        json["buffers"] = json!([{"byteLength": self.bin.len(), "uri": uri}]);
        // Lists that are there must not be empty.
        let object = json.as_object_mut().expect("an object");
        object.retain(|_, v| v.as_array().is_none_or(|a| !a.is_empty()));
        serde_json::to_vec(&json).expect("JSON")
    }

    fn load(&self) -> Result<Model, ModelError> {
        load_glb(&self.text(None), "own.gltf")
    }

    fn problem(&self) -> String {
        self.load().expect_err("must be refused").to_string()
    }
}

fn triangle_count(m: &Model, zone: Zone) -> usize {
    m.parts.iter().filter(|p| p.zone == zone).map(|p| p.indices.len() / 3).sum()
}

#[test]
fn a_plain_boat_is_read_in_boat_axes() {
    let m = GltfFile::boat().load().expect("loads");
    assert_eq!(m.kind, ModelKind::Mesh);
    assert_eq!((m.min, m.max), (Vec3::new(-4.5, -1.0, -0.6), Vec3::new(4.0, 1.0, 2.0)));
    for zone in Zone::ALL {
        assert_eq!(triangle_count(&m, zone), 12, "{zone:?}");
    }
    // The hull's outline, without the engine behind it.
    let mut outline: Vec<_> = m.waterline.iter().map(|p| (p.x, p.y)).collect();
    outline.sort_by(|a, b| a.partial_cmp(b).expect("numbers"));
    assert_eq!(outline, [(-4.0, -1.0), (-4.0, 1.0), (4.0, -1.0), (4.0, 1.0)]);
    // No normals in the file: flat ones, pointing outwards.
    for t in m.indices.chunks_exact(3) {
        let [a, b, c] = [0, 1, 2].map(|k| m.vertices[t[k] as usize]);
        let face = (b.position - a.position).cross(c.position - a.position).normalize();
        assert!([a, b, c].iter().all(|v| v.normal.distance(face) < 1e-5));
    }
    assert!(m.texture.is_none());
    assert!(m.vertices.iter().all(|v| v.albedo == Vec3::ONE));
}

#[test]
fn names_are_found_on_nodes_meshes_and_ancestors() {
    let mut file = GltfFile::boat();
    // The engine's name moves to its mesh, the helm's to a parent.
    file.json["nodes"][1]["name"] = json!("Cube");
    file.json["meshes"][1]["name"] = json!("Engine.001");
    file.json["nodes"][2]["name"] = json!("Cube.002");
    let parent = file.push("nodes", json!({"name": "HELM", "children": [2]}));
    file.json["scenes"][0]["nodes"] = json!([0, 1, parent]);
    let m = file.load().expect("loads");
    assert_eq!(triangle_count(&m, Zone::Engine), 12);
    assert_eq!(triangle_count(&m, Zone::Helm), 12);
}

#[test]
fn missing_parts_are_named_with_what_was_found() {
    let mut file = GltfFile::boat();
    file.json["nodes"][1]["name"] = json!("motor");
    let error = file.load().expect_err("no engine");
    let ModelError::MissingPart { needed, found, .. } = &error else { panic!("{error}") };
    assert_eq!(needed, &["engine"]);
    assert_eq!(found, &["hull", "motor", "helm"]);
    let line = error.to_string();
    assert!(line.starts_with("own.gltf: ") && line.contains("engine") && line.contains("motor"), "{line}");
    file.json["nodes"][2].as_object_mut().expect("node").remove("name");
    let error = file.load().expect_err("neither");
    assert!(
        matches!(&error, ModelError::MissingPart { needed, .. } if needed == &["engine", "helm"]),
        "{error}"
    );
}

#[test]
fn transforms_apply_along_the_tree_and_mirroring_keeps_fronts_outside() {
    let mut file = GltfFile::boat();
    file.json["nodes"][0]["scale"] = json!([-1.0, 1.0, 1.0]);
    file.json["nodes"][2]["translation"] = json!([0.0, 0.0, 1.0]);
    let parent =
        file.push("nodes", json!({"name": "boat", "children": [0, 1, 2], "translation": [0.0, 0.25, 0.0]}));
    file.json["scenes"][0]["nodes"] = json!([parent]);
    let m = file.load().expect("loads");
    assert!((m.max.z - 2.25).abs() < 1e-6 && (m.min.z + 0.35).abs() < 1e-6);
    let part = |zone: Zone| m.parts.iter().find(|p| p.zone == zone).expect("part").indices.clone();
    let corners = |zone: Zone| {
        part(zone).map(|k| m.vertices[m.indices[k as usize] as usize].position).collect::<Vec<_>>()
    };
    assert!((corners(Zone::Helm).iter().map(|p| p.x).fold(f32::MIN, f32::max) - 1.0).abs() < 1e-6);
    for zone in Zone::ALL {
        let volume: f32 = corners(zone).chunks_exact(3).map(|t| t[0].dot(t[1].cross(t[2])) / 6.0).sum();
        assert!(volume > 0.1, "{zone:?} is inside out: {volume}");
    }
}

#[test]
fn indices_of_every_width_strips_and_fans_give_the_same_triangles() {
    let want = triangle_count(&GltfFile::boat().load().expect("loads"), Zone::Hull);
    for (component, width) in [(5121, 1), (5123, 2), (5125, 4)] {
        let mut file = GltfFile::boat();
        let (_, indices) = box_corners([0.0; 3], [1.0; 3]);
        let bytes = indices.iter().flat_map(|i| i.to_le_bytes()[..width].to_vec()).collect();
        let accessor = file.accessor(bytes, component, "SCALAR", indices.len());
        file.primitive(0)["indices"] = json!(accessor);
        assert_eq!(triangle_count(&file.load().expect("loads"), Zone::Hull), want);
    }
    // A square on the water as strip and as fan beside the hull: two triangles more.
    for (mode, order) in [(5, [0_u16, 1, 3, 2]), (6, [0, 1, 2, 3])] {
        let mut file = GltfFile::boat();
        let square = [[-1.0, -1.0, 4.0], [1.0, -1.0, 4.0], [1.0, 1.0, 4.0], [-1.0, 1.0, 4.0]];
        let position = file.floats(&square);
        let bytes = order.iter().flat_map(|i| i.to_le_bytes()).collect();
        let indices = file.accessor(bytes, 5123, "SCALAR", 4);
        file.mesh("plate", json!({"attributes": {"POSITION": position}, "indices": indices, "mode": mode}));
        let m = file.load().expect("loads");
        assert_eq!(triangle_count(&m, Zone::Hull), want + 2);
        let plate = m.vertices.iter().rev().filter(|v| v.normal.x.abs() > 0.99 && v.position.x > 3.99);
        assert!(plate.clone().count() >= 6 && plate.clone().all(|v| v.normal.x > 0.0), "mode {mode}");
    }
}

#[test]
fn colours_of_materials_and_corners_multiply() {
    let mut file = GltfFile::boat();
    let material =
        file.push("materials", json!({"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.25, 1.0, 1.0]}}));
    let colours = file.accessor([255, 51, 0, 255].repeat(8), 5121, "VEC4", 8);
    file.json["accessors"][colours]["normalized"] = json!(true);
    file.primitive(0)["material"] = json!(material);
    file.primitive(0)["attributes"]["COLOR_0"] = json!(colours);
    let m = file.load().expect("loads");
    let hull = m.vertices[m.indices[0] as usize].albedo;
    assert!(hull.distance(Vec3::new(0.5, 0.05, 0.0)) < 1e-6, "{hull}");
}

/// A PNG of one colour.
fn png(width: u32, height: u32, colour: [u8; 4]) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let image = image::RgbaImage::from_pixel(width, height, image::Rgba(colour));
    image.write_to(&mut bytes, image::ImageFormat::Png).expect("PNG");
    bytes.into_inner()
}

/// Gives the part of mesh `mesh` an embedded picture, its coordinates from 0 to `reach`.
fn add_picture(file: &mut GltfFile, mesh: usize, picture: &[u8], reach: f32) {
    let uri = format!("data:image/png;base64,{}", STANDARD.encode(picture));
    let image = file.push("images", json!({"uri": uri}));
    let texture = file.push("textures", json!({"source": image}));
    let material =
        file.push("materials", json!({"pbrMetallicRoughness": {"baseColorTexture": {"index": texture}}}));
    let uv: Vec<[f32; 2]> = (0..8).map(|i| [(i % 2) as f32 * reach, (i / 2 % 2) as f32 * reach]).collect();
    let uv = file.floats(&uv);
    file.primitive(mesh)["material"] = json!(material);
    file.primitive(mesh)["attributes"]["TEXCOORD_0"] = json!(uv);
}

fn texel(m: &Model, uv: Vec2) -> [u8; 3] {
    let t = m.texture.as_ref().expect("texture");
    let x = ((uv.x * t.width as f32) as usize).min(t.width as usize - 1);
    let y = ((uv.y * t.height as f32) as usize).min(t.height as usize - 1);
    let i = (y * t.width as usize + x) * 4;
    [t.rgba[i], t.rgba[i + 1], t.rgba[i + 2]]
}

#[test]
fn several_pictures_share_one_texture_and_plain_parts_stay_plain() {
    let mut file = GltfFile::boat();
    add_picture(&mut file, 0, &png(40, 20, [255, 0, 0, 255]), 1.0);
    add_picture(&mut file, 1, &png(8, 64, [0, 0, 255, 255]), 1.0);
    let m = file.load().expect("loads");
    for (zone, want) in
        [(Zone::Hull, [255, 0, 0]), (Zone::Engine, [0, 0, 255]), (Zone::Helm, [255, 255, 255])]
    {
        let part = m.parts.iter().find(|p| p.zone == zone).expect("part");
        for k in part.indices.clone() {
            let uv = m.vertices[m.indices[k as usize] as usize].uv;
            // A little inside the corner, where the neighbour's pixels would show.
            assert_eq!(texel(&m, uv), want, "{zone:?} at {uv}");
        }
    }
}

#[test]
fn texture_transforms_move_and_scale_the_coordinates() {
    let mut file = GltfFile::boat();
    add_picture(&mut file, 0, &png(8, 8, [10, 20, 30, 255]), 1.0);
    file.json["extensionsUsed"] = json!(["KHR_texture_transform"]);
    file.json["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] =
        json!({"KHR_texture_transform": {"offset": [0.5, 0.25], "scale": [0.5, 0.5]}});
    // All parts wear the picture: it is kept as it is, and so are its coordinates.
    let (material, uv) =
        (file.primitive(0)["material"].clone(), file.primitive(0)["attributes"]["TEXCOORD_0"].clone());
    for mesh in [1, 2] {
        file.primitive(mesh)["material"] = material.clone();
        file.primitive(mesh)["attributes"]["TEXCOORD_0"] = uv.clone();
    }
    let m = file.load().expect("loads");
    assert_eq!(m.texture.as_ref().map(|t| (t.width, t.height)), Some((8, 8)));
    let low = m.vertices.iter().map(|v| v.uv).reduce(Vec2::min).expect("vertices");
    let high = m.vertices.iter().map(|v| v.uv).reduce(Vec2::max).expect("vertices");
    assert_eq!((low, high), (Vec2::new(0.5, 0.25), Vec2::new(1.0, 0.75)));
}

#[test]
fn a_picture_that_repeats_becomes_its_mean_colour() {
    let mut file = GltfFile::boat();
    add_picture(&mut file, 0, &png(4, 4, [188, 188, 0, 255]), 3.0);
    let m = file.load().expect("loads");
    assert!(m.texture.is_none());
    let hull = m.vertices[m.indices[0] as usize].albedo;
    assert!(hull.distance(Vec3::new(0.503, 0.503, 0.0)) < 0.01, "{hull}");
}

#[test]
fn buffers_and_pictures_are_found_beside_the_file_and_nowhere_else() {
    let dir = tempfile::tempdir().expect("folder");
    let file = GltfFile::boat();
    fs::create_dir(dir.path().join("data files")).expect("folder");
    fs::write(dir.path().join("data files/boat.bin"), &file.bin).expect("written");
    fs::write(dir.path().join("own.gltf"), file.text(Some("data%20files/boat.bin"))).expect("written");
    let m = resolve("own.gltf", dir.path()).expect("loads");
    assert_eq!(m.name, "own");
    assert_eq!(m.indices, file.load().expect("loads").indices);

    for uri in ["../boat.bin", "/etc/hostname", "%2e%2e/boat.bin", "http://example.org/boat.bin", ""] {
        let inner = dir.path().join("inner");
        fs::create_dir_all(&inner).expect("folder");
        fs::write(dir.path().join("boat.bin"), &file.bin).expect("written");
        fs::write(inner.join("own.gltf"), file.text(Some(uri))).expect("written");
        let line = load(&inner.join("own.gltf")).expect_err("must be refused").to_string();
        assert!(line.contains("folder"), "{uri}: {line}");
    }
    let line = load_glb(&file.text(Some("boat.bin")), "own").expect_err("no folder").to_string();
    assert!(line.contains("boat.bin"), "{line}");
    fs::write(dir.path().join("own.gltf"), file.text(Some("gone.bin"))).expect("written");
    let line = load(&dir.path().join("own.gltf")).expect_err("gone").to_string();
    assert!(line.contains("gone.bin"), "{line}");
}

#[test]
fn boats_in_the_wrong_place_or_size_are_refused() {
    let shifted = |y: f32| {
        let mut file = GltfFile::boat();
        let top = file.push("nodes", json!({"children": [0, 1, 2], "translation": [0.0, y, 0.0]}));
        file.json["scenes"][0]["nodes"] = json!([top]);
        file.load().expect_err("must be refused")
    };
    assert!(matches!(shifted(3.0), ModelError::Afloat { lowest_m, .. } if (lowest_m - 2.4).abs() < 1e-5));
    assert!(matches!(shifted(-3.0), ModelError::Sunk { highest_m, .. } if (highest_m + 1.0).abs() < 1e-5));
    let with = |key: &str, value: Value| {
        let mut file = GltfFile::boat();
        let top = file.push("nodes", json!({"children": [0, 1, 2], key: value}));
        file.json["scenes"][0]["nodes"] = json!([top]);
        file.load().expect_err("must be refused")
    };
    assert!(matches!(with("scale", json!([1000.0, 1000.0, 1000.0])), ModelError::Size { .. }));
    assert!(matches!(with("scale", json!([0.001, 0.001, 0.001])), ModelError::Size { .. }));
    assert!(matches!(with("rotation", json!([0.0, 0.6, 0.0, 0.8])), ModelError::Across { .. }));
    let line = with("scale", json!([0.0, 1.0, 1.0])).to_string();
    assert!(line.contains("flattens"), "{line}");
}

#[test]
fn files_that_contradict_themselves_are_refused_with_a_reason() {
    type Spoil = fn(&mut GltfFile);
    let cases: [(&str, Spoil); 14] = [
        ("reached twice", |f| f.json["nodes"][0]["children"] = json!([0])),
        ("accessor", |f| f.primitive(0)["attributes"]["POSITION"] = json!(999)),
        ("primitives[0].indices", |f| f.primitive(0)["indices"] = json!(999)),
        ("reaches beyond", |f| f.json["accessors"][1]["count"] = json!(400)),
        ("reaches beyond", |f| f.json["accessors"][1]["byteOffset"] = json!(u64::MAX)),
        ("at most 1000000", |f| f.json["accessors"][0]["count"] = json!(u64::MAX)),
        ("outside its buffer", |f| f.json["bufferViews"][0]["byteOffset"] = json!(u64::MAX)),
        ("positions", |f| {
            let short = f.floats(&[[0.0, 0.0, 1.0]; 3]);
            f.primitive(0)["attributes"]["NORMAL"] = json!(short);
        }),
        ("sparse", |f| {
            f.json["accessors"][0]["sparse"] = json!({"count": 1, "indices": {"bufferView": 1, "componentType": 5123}, "values": {"bufferView": 0}});
        }),
        ("corner", |f| {
            let bytes = [9_u16, 1, 2].iter().flat_map(|i| i.to_le_bytes()).collect();
            let indices = f.accessor(bytes, 5123, "SCALAR", 3);
            f.primitive(0)["indices"] = json!(indices);
        }),
        ("KHR_draco", |f| f.json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"])),
        ("not finite", |f| f.bin[..4].copy_from_slice(&f32::NAN.to_le_bytes())),
        ("no triangles", |f| f.json["scenes"][0]["nodes"] = json!([])),
        ("picture 0", |f| {
            add_picture(f, 0, b"no picture", 1.0);
        }),
    ];
    for (what, spoil) in cases {
        let mut file = GltfFile::boat();
        spoil(&mut file);
        let line = file.problem();
        assert!(line.contains(what) && line.starts_with("own.gltf"), "{what}: {line}");
        assert!(!line.contains('\n'), "{line}");
    }
}

#[test]
fn an_image_without_a_source_and_a_missing_blob_are_errors() {
    let mut file = GltfFile::boat();
    add_picture(&mut file, 0, &png(2, 2, [1, 2, 3, 255]), 1.0);
    file.json["images"][0] = json!({"name": "nothing"});
    assert!(file.problem().contains("picture 0"));
    let mut json: Value = serde_json::from_slice(&GltfFile::boat().text(None)).expect("JSON");
    json["buffers"][0].as_object_mut().expect("buffer").remove("uri");
    let line = load_glb(&serde_json::to_vec(&json).expect("JSON"), "own").expect_err("no blob").to_string();
    assert!(line.contains("binary chunk"), "{line}");
}

#[test]
fn unknown_names_list_the_known_ones() {
    let line = resolve("battleship", Path::new("/nowhere")).expect_err("unknown").to_string();
    for name in ["battleship", "skiff", "rhib", "dhow", "frigate", "frigate-quad", ".glb"] {
        assert!(line.contains(name), "{line}");
    }
    let line = resolve("gone.glb", Path::new("/nowhere")).expect_err("gone").to_string();
    assert!(line.starts_with("/nowhere/gone.glb: "), "{line}");
    let line = load(Path::new("/dev/zero")).expect_err("no plain file").to_string();
    assert!(line.contains("not a plain file"), "{line}");
}

#[test]
fn a_truncated_file_is_refused_at_every_length() {
    let whole = build_glb(Boat::Skiff);
    for length in (0..whole.len()).step_by(997).chain(0..40) {
        let line = load_glb(&whole[..length], "cut").expect_err("must be refused").to_string();
        assert!(line.starts_with("cut: "), "{line}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// Flipped bytes anywhere: a model that holds together, or an error; never a panic.
    #[test]
    fn damaged_files_never_panic(
        damage in proptest::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..12),
        in_head: bool,
    ) {
        let mut bytes = build_glb(Boat::Skiff);
        let json_end = 20 + u32::from_le_bytes([bytes[12], bytes[13], bytes[14], bytes[15]]) as usize;
        let reach = if in_head { json_end } else { bytes.len() };
        for (at, value) in damage {
            bytes[at.index(reach)] = value;
        }
        if let Ok(m) = load_glb(&bytes, "damaged") {
            prop_assert!(m.indices.iter().all(|&i| (i as usize) < m.vertices.len()));
            prop_assert!(m.vertices.iter().all(|v| v.position.is_finite() && v.normal.is_finite()));
            prop_assert!(m.waterline.len() >= 3);
        }
    }

    /// Numbers of the JSON replaced by others.
    #[test]
    fn wild_numbers_never_panic(
        edits in proptest::collection::vec((any::<prop::sample::Index>(), prop_oneof![
            Just(json!(-1)), Just(json!(0)), Just(json!(1)), Just(json!(5)), Just(json!(5126)), Just(json!(5121)),
            Just(json!(1_u64 << 33)), Just(json!(u64::MAX)), Just(json!(1e30)), Just(json!("VEC4")), Just(json!([])),
        ]), 1..4),
    ) {
        let mut file = GltfFile::boat();
        add_picture(&mut file, 0, &png(4, 4, [9, 9, 9, 200]), 1.0);
        let mut json: Value = serde_json::from_slice(&file.text(None)).expect("JSON");
        let mut paths = Vec::new();
        numbers(&json, String::new(), &mut paths);
        for (at, value) in edits {
            if let Some(place) = json.pointer_mut(at.get::<String>(&paths)) {
                *place = value;
            }
        }
        if let Ok(m) = load_glb(&serde_json::to_vec(&json).expect("JSON"), "wild") {
            prop_assert!(m.indices.iter().all(|&i| (i as usize) < m.vertices.len()));
            prop_assert!(m.vertices.iter().all(|v| v.position.is_finite()));
        }
    }
}

/// Pointers to all numbers and shape names in `value`.
fn numbers(value: &Value, path: String, out: &mut Vec<String>) {
    match value {
        Value::Number(_) => out.push(path),
        Value::String(s) if s.starts_with("VEC") || s == "SCALAR" => out.push(path),
        Value::Array(all) => all.iter().enumerate().for_each(|(i, v)| numbers(v, format!("{path}/{i}"), out)),
        Value::Object(all) => all.iter().for_each(|(k, v)| numbers(v, format!("{path}/{k}"), out)),
        _ => {}
    }
}
