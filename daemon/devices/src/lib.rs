//! Camera, serial line and trigger of the gun computer.
