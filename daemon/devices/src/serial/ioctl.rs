//! The serial ioctls that termios lacks: binding, then typed calls.
//!
//! Numbers and layouts: Linux `asm-generic/ioctls.h` and `linux/serial.h`, as x86, Arm and RISC-V have them.

use std::{ffi::c_void, mem, os::fd::AsFd};

use rustix::{
    io::Errno,
    ioctl::{Getter, Opcode, Setter, ioctl},
};

const TIOCGSERIAL: Opcode = 0x541e;
const TIOCSSERIAL: Opcode = 0x541f;
const TIOCGICOUNT: Opcode = 0x545d;

/// "Hand bytes on at once": a flag that a user without privileges may set.
const ASYNC_LOW_LATENCY: i32 = 1 << 13;

/// `struct serial_struct`.
#[repr(C)]
struct SerialStruct {
    kind: i32,
    line: i32,
    port: u32,
    irq: i32,
    flags: i32,
    xmit_fifo_size: i32,
    custom_divisor: i32,
    baud_base: i32,
    close_delay: u16,
    io_type: u8,
    reserved_char: u8,
    hub6: i32,
    closing_wait: u16,
    closing_wait2: u16,
    iomem_base: *mut c_void,
    iomem_reg_shift: u16,
    port_high: u32,
    iomap_base: usize,
}

#[cfg(target_pointer_width = "64")]
const _: () =
    assert!(mem::size_of::<SerialStruct>() == 72 && mem::offset_of!(SerialStruct, iomem_base) == 48);

/// `struct serial_icounter_struct`.
#[repr(C)]
struct InputCounts {
    cts: i32,
    dsr: i32,
    rng: i32,
    dcd: i32,
    rx: i32,
    tx: i32,
    frame: i32,
    overrun: i32,
    parity: i32,
    brk: i32,
    buf_overrun: i32,
    reserved: [i32; 9],
}

const _: () = assert!(mem::size_of::<InputCounts>() == 80);

/// Errors that the port has counted since it was made, or since it last wrapped.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct LineErrors {
    /// Bytes without a stop bit: most often a wrong baud rate.
    pub framing: u32,
    /// Bytes lost in the adapter or in the kernel because they were not fetched in time.
    pub overrun: u32,
}

/// Reads the port's own counts of errors; a pseudo-terminal has none (`ENOTTY`).
pub(super) fn line_errors(port: impl AsFd) -> Result<LineErrors, Errno> {
    // SAFETY: TIOCGICOUNT writes a `serial_icounter_struct`, whose layout `InputCounts` has (size asserted above); every
    // bit pattern is a value of it.
    let counts = unsafe { ioctl(port, Getter::<TIOCGICOUNT, InputCounts>::new()) }?;
    Ok(LineErrors {
        framing: counts.frame.cast_unsigned(),
        overrun: counts.overrun.cast_unsigned().wrapping_add(counts.buf_overrun.cast_unsigned()),
    })
}

/// Has the port hand bytes on at once where its driver can; whether it does afterwards. Drivers without such a flag take
/// the call and forget it, or refuse it.
pub(super) fn set_low_latency(port: impl AsFd) -> Result<bool, Errno> {
    let port = port.as_fd();
    let read = || {
        // SAFETY: TIOCGSERIAL writes a `serial_struct`, whose layout `SerialStruct` has (size and offset asserted above);
        // every bit pattern is a value of it, the pointer in it is never followed.
        unsafe { ioctl(port, Getter::<TIOCGSERIAL, SerialStruct>::new()) }
    };
    let mut settings = read()?;
    if settings.flags & ASYNC_LOW_LATENCY != 0 {
        return Ok(true);
    }
    settings.flags |= ASYNC_LOW_LATENCY;
    // SAFETY: TIOCSSERIAL reads a `serial_struct`; this one came from the kernel with one flag changed.
    unsafe { ioctl(port, Setter::<TIOCSSERIAL, SerialStruct>::new(settings)) }?;
    Ok(read()?.flags & ASYNC_LOW_LATENCY != 0)
}
