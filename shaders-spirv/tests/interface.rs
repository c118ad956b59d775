//! The structs of `interface` against the blocks that the compiled shaders really have.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test that cannot go on has failed"
)]

use std::collections::HashMap;

use rspirv::{
    dr::{Instruction, Module, Operand, load_words},
    spirv::{Decoration, Op, StorageClass, Word},
};
use shaders_spirv::interface::{
    BoatBlock, ContactBlock, DrawBlock, FrameBlock, FullBlock, FullPublishedBlock, HULL_LINE_COLUMNS,
    HudQuad, LamplightBlock, LamplightNode, LightBlock, LobeBlock, MeshVertex, MirrorBlock, PhantomBlock,
    PhysicsBlock, PhysicsPublishedBlock, PoolBlock, ReflectBlock, RoundBlock, ShadowBlock, TRACK_POINTS,
    VideoBlock, WATERS_MAX, WakeBlock, WakeHead, WakePoint, WaterBlock,
};

/// Name, fields with offsets, and size of one struct of the host.
type Host = (&'static str, &'static [(&'static str, u32)], usize);

const HOST: &[Host] = &[
    ("FrameBlock", FrameBlock::FIELDS, size_of::<FrameBlock>()),
    ("BoatBlock", BoatBlock::FIELDS, size_of::<BoatBlock>()),
    ("WaterBlock", WaterBlock::FIELDS, size_of::<WaterBlock>()),
    ("MirrorBlock", MirrorBlock::FIELDS, size_of::<MirrorBlock>()),
    ("FullPublishedBlock", FullPublishedBlock::FIELDS, size_of::<FullPublishedBlock>()),
    ("FullBlock", FullBlock::FIELDS, size_of::<FullBlock>()),
    ("PhysicsPublishedBlock", PhysicsPublishedBlock::FIELDS, size_of::<PhysicsPublishedBlock>()),
    ("PhysicsBlock", PhysicsBlock::FIELDS, size_of::<PhysicsBlock>()),
    ("ContactBlock", ContactBlock::FIELDS, size_of::<ContactBlock>()),
    ("RoundBlock", RoundBlock::FIELDS, size_of::<RoundBlock>()),
    ("HudQuad", HudQuad::FIELDS, size_of::<HudQuad>()),
    ("VideoBlock", VideoBlock::FIELDS, size_of::<VideoBlock>()),
    ("PhantomBlock", PhantomBlock::FIELDS, size_of::<PhantomBlock>()),
    ("LightBlock", LightBlock::FIELDS, size_of::<LightBlock>()),
    ("LamplightBlock", LamplightBlock::FIELDS, size_of::<LamplightBlock>()),
    ("LamplightNode", LamplightNode::FIELDS, size_of::<LamplightNode>()),
    ("PoolBlock", PoolBlock::FIELDS, size_of::<PoolBlock>()),
    ("ShadowBlock", ShadowBlock::FIELDS, size_of::<ShadowBlock>()),
    ("DrawBlock", DrawBlock::FIELDS, size_of::<DrawBlock>()),
    ("LobeBlock", LobeBlock::FIELDS, size_of::<LobeBlock>()),
    ("WakePoint", WakePoint::FIELDS, size_of::<WakePoint>()),
    ("WakeHead", WakeHead::FIELDS, size_of::<WakeHead>()),
    ("WakeBlock", WakeBlock::FIELDS, size_of::<WakeBlock>()),
    ("ReflectBlock", ReflectBlock::FIELDS, size_of::<ReflectBlock>()),
];

fn modules() -> Vec<(&'static str, Module)> {
    shaders_spirv::ALL.iter().map(|s| (s.name, load_words(s.words()).unwrap())).collect()
}

fn word(operand: &Operand) -> Word {
    match operand {
        Operand::IdRef(w) | Operand::LiteralBit32(w) => *w,
        other => panic!("no word: {other:?}"),
    }
}

fn text(operand: &Operand) -> &str {
    match operand {
        Operand::LiteralString(s) => s,
        other => panic!("no text: {other:?}"),
    }
}

/// One struct type of a module.
#[derive(Default)]
struct Shape {
    names: HashMap<Word, String>,
    offsets: HashMap<Word, Word>,
}

fn structs(module: &Module) -> HashMap<Word, (String, Shape)> {
    let mut all: HashMap<Word, (String, Shape)> = HashMap::new();
    for i in &module.debug_names {
        match i.class.opcode {
            Op::Name => all.entry(word(&i.operands[0])).or_default().0 = text(&i.operands[1]).to_owned(),
            Op::MemberName => {
                let shape = &mut all.entry(word(&i.operands[0])).or_default().1;
                shape.names.insert(word(&i.operands[1]), text(&i.operands[2]).to_owned());
            }
            _ => {}
        }
    }
    for i in member_offsets(module) {
        let shape = &mut all.entry(word(&i.operands[0])).or_default().1;
        shape.offsets.insert(word(&i.operands[1]), word(&i.operands[3]));
    }
    all
}

fn member_offsets(module: &Module) -> impl Iterator<Item = &Instruction> {
    let offset = Operand::Decoration(Decoration::Offset);
    module.annotations.iter().filter(move |i| i.class.opcode == Op::MemberDecorate && i.operands[2] == offset)
}

#[test]
fn blocks_have_the_offsets_of_their_structs() {
    let mut met: Vec<&str> = Vec::new();
    for (shader, module) in modules() {
        for (name, shape) in structs(&module).values() {
            // A struct without offsets is a shader's own copy.
            let Some((host, fields, _)) =
                HOST.iter().find(|(host, _, _)| host == name && !shape.offsets.is_empty())
            else {
                continue;
            };
            met.push(host);
            let members: Vec<_> = (0..shape.offsets.len() as Word)
                .map(|m| (shape.names[&m].as_str(), shape.offsets[&m]))
                .collect();
            assert_eq!(members, *fields, "{name} in {shader}");
        }
    }
    for (name, _, _) in HOST {
        assert!(met.contains(name), "no shader has {name}");
    }
}

#[test]
fn arrays_of_blocks_have_the_stride_and_length_of_the_hosts() {
    let stride = Operand::Decoration(Decoration::ArrayStride);
    let mut met = Vec::new();
    for (shader, module) in modules() {
        let names = structs(&module);
        let constants: HashMap<Word, Word> = module
            .types_global_values
            .iter()
            .filter(|i| i.class.opcode == Op::Constant)
            .filter_map(|i| match i.operands[0] {
                Operand::LiteralBit32(v) => Some((i.result_id.unwrap(), v)),
                _ => None,
            })
            .collect();
        for i in &module.types_global_values {
            if i.class.opcode != Op::TypeArray && i.class.opcode != Op::TypeRuntimeArray {
                continue;
            }
            let Some((name, shape)) = names.get(&word(&i.operands[0])) else { continue };
            let Some((host, _, size)) = HOST.iter().find(|(h, _, _)| h == name && !shape.offsets.is_empty())
            else {
                continue;
            };
            let decorated = module.annotations.iter().find(|a| {
                a.class.opcode == Op::Decorate
                    && word(&a.operands[0]) == i.result_id.unwrap()
                    && a.operands[1] == stride
            });
            assert_eq!(word(&decorated.unwrap().operands[2]) as usize, *size, "stride of {name} in {shader}");
            if i.class.opcode == Op::TypeArray {
                let length = constants[&word(&i.operands[1])] as usize;
                let wanted = match *host {
                    "WakePoint" => TRACK_POINTS,
                    _ => WATERS_MAX,
                };
                assert_eq!(length, wanted, "{name} in {shader}");
                // What Vulkan promises every uniform block.
                assert!(length * size <= 16384);
            }
            met.push(*host);
        }
    }
    for name in ["BoatBlock", "WaterBlock", "RoundBlock", "HudQuad"] {
        assert!(met.contains(&name), "no shader has an array of {name}");
    }
    assert_eq!(HULL_LINE_COLUMNS % 4, 0, "the table is an array of vec4");
}

#[test]
fn vertex_inputs_are_the_meshs() {
    for (shader, module) in
        modules().into_iter().filter(|(name, _)| name.starts_with("boat") && name.ends_with("vert"))
    {
        let names = structs(&module);
        let mut inputs: Vec<(Word, String)> = Vec::new();
        for i in &module.types_global_values {
            if i.class.opcode != Op::Variable || i.operands[0] != Operand::StorageClass(StorageClass::Input) {
                continue;
            }
            let id = i.result_id.unwrap();
            let location = module.annotations.iter().find(|a| {
                a.class.opcode == Op::Decorate
                    && word(&a.operands[0]) == id
                    && a.operands[1] == Operand::Decoration(Decoration::Location)
            });
            inputs.extend(location.map(|l| (word(&l.operands[2]), names[&id].0.clone())));
        }
        inputs.sort();
        let wanted: Vec<_> = MeshVertex::FIELDS.iter().map(|(name, _)| (*name).to_owned()).collect();
        // A boat without a texture takes no texture coordinate.
        for (location, name) in &inputs {
            assert_eq!(wanted.get(*location as usize), Some(name), "{shader}");
        }
        assert!(inputs.len() >= 3, "{shader}: {inputs:?}");
    }
}
