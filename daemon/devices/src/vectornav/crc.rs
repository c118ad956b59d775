//! The check sum of VectorNav's binary output.

/// CRC16-CCITT as VectorNav uses it: polynomial 0x1021, most significant bit first, starting at 0. Over a packet's bytes
/// after the sync byte, its own two CRC bytes included, the result is 0.
pub fn crc16(bytes: &[u8]) -> u16 {
    bytes.iter().fold(0, |crc, &byte| (crc << 8) ^ TABLE[usize::from((crc >> 8) as u8 ^ byte)])
}

const TABLE: [u16; 256] = table();

const fn table() -> [u16; 256] {
    let mut table = [0; 256];
    let mut i = 0;
    while i < 256 {
        let mut crc = (i as u16) << 8;
        let mut bit = 0;
        while bit < 8 {
            crc = if crc & 0x8000 != 0 { (crc << 1) ^ 0x1021 } else { crc << 1 };
            bit += 1;
        }
        table[i] = crc;
        i += 1;
    }
    table
}

#[cfg(test)]
mod tests {
    use super::crc16;

    /// Check value of CRC-16/XMODEM (same polynomial, start and order) in the CRC catalogue of Greg Cook.
    #[test]
    fn matches_the_catalogue() {
        assert_eq!(crc16(b"123456789"), 0x31c3);
    }

    #[test]
    fn is_zero_over_data_and_its_own_crc() {
        let mut bytes = vec![0x01, 0x29, 0x01, 0xfa, 0x00];
        bytes.extend(crc16(&bytes).to_be_bytes());
        assert_eq!(crc16(&bytes), 0);
    }
}
