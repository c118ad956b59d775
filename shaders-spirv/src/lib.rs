//! Shaders as SPIR-V and the structs they share with the host.
