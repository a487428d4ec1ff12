//! The planes of quantised depth maps (`D2`): half floats, octahedral normals, 8-bit confidences.

/// How a file scales its planes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Quantization {
    depth_scale: f32,
    confidence_scale: f32,
}

impl Quantization {
    /// Depths are stored divided by `2^exponent`, confidences as shares of `confidence_scale`.
    pub(super) fn new(exponent: i8, confidence_scale: f32) -> Self {
        Quantization { depth_scale: 2f32.powi(exponent.into()), confidence_scale }
    }

    /// Depth from a half float.
    pub(super) fn depth(self, bytes: [u8; 2]) -> f32 {
        half_to_f32(u16::from_le_bytes(bytes)) * self.depth_scale
    }

    /// Confidence from a share in 255ths.
    pub(super) fn confidence(self, [share]: [u8; 1]) -> f32 {
        f32::from(share) / 255.0 * self.confidence_scale
    }
}

/// IEEE 754 binary16 to binary32, exactly.
fn half_to_f32(half: u16) -> f32 {
    let sign = u32::from(half & 0x8000) << 16;
    let exponent = u32::from(half >> 10 & 0x1f);
    let fraction = u32::from(half & 0x3ff);
    match exponent {
        0 => {
            let magnitude = fraction as f32 * 2f32.powi(-24);
            f32::from_bits(magnitude.to_bits() | sign)
        }
        0x1f => f32::from_bits(sign | 0x7f80_0000 | fraction << 13),
        _ => f32::from_bits(sign | (exponent + 127 - 15) << 23 | fraction << 13),
    }
}

/// Unit normal from its octahedral coordinates; the zero vector where there is none.
///
/// Source: Meyer et al. 2010, "On Floating-Point Normal Vectors".
pub(super) fn normal([a0, a1, b0, b1]: [u8; 4]) -> [f32; 3] {
    let (a, b) = (i16::from_le_bytes([a0, a1]), i16::from_le_bytes([b0, b1]));
    if (a, b) == (i16::MIN, i16::MIN) {
        return [0.0; 3];
    }
    let (p, q) = (f32::from(a) / 32767.0, f32::from(b) / 32767.0);
    let z = 1.0 - p.abs() - q.abs();
    let sign = |v: f32| if v < 0.0 { -1.0 } else { 1.0 };
    let (x, y) = if z < 0.0 { ((1.0 - q.abs()) * sign(p), (1.0 - p.abs()) * sign(q)) } else { (p, q) };
    let length = (x * x + y * y + z * z).sqrt();
    [x / length, y / length, z / length]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_floats_are_exact() {
        for (half, value) in [
            (0x0000, 0.0),
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65504.0),
            (0x0400, 2f32.powi(-14)),
            (0x0001, 2f32.powi(-24)),
            (0x03ff, 1023.0 * 2f32.powi(-24)),
            (0x3555, 0.333_251_95),
            (0x7c00, f32::INFINITY),
        ] {
            assert_eq!(half_to_f32(half), value, "{half:#06x}");
        }
        assert!(half_to_f32(0x7e00).is_nan());
        assert!(half_to_f32(0x8000).is_sign_negative());
    }

    #[test]
    fn depth_and_confidence_are_scaled() {
        let q = Quantization::new(-3, 2.0);
        assert_eq!(q.depth([0x00, 0x40]), 0.25);
        assert_eq!(q.confidence([255]), 2.0);
        assert_eq!(q.confidence([0]), 0.0);
    }

    #[test]
    fn octahedral_normals_cover_the_sphere() {
        let encode = |n: [f32; 3]| {
            let sum = n.iter().map(|v| v.abs()).sum::<f32>();
            let (mut p, mut q) = (n[0] / sum, n[1] / sum);
            if n[2] < 0.0 {
                let sign = |v: f32| if v < 0.0 { -1.0 } else { 1.0 };
                (p, q) = ((1.0 - q.abs()) * sign(p), (1.0 - p.abs()) * sign(q));
            }
            let [a, b] = [p, q].map(|v| ((v * 32767.0).round() as i16).to_le_bytes());
            [a[0], a[1], b[0], b[1]]
        };
        for i in 0..200 {
            let z = 1.0 - 2.0 * (i as f32 + 0.5) / 200.0;
            let angle = 2.4 * i as f32;
            let r = (1.0 - z * z).sqrt();
            let n = [r * angle.cos(), r * angle.sin(), z];
            let back = normal(encode(n));
            // Half a step of 1/32767 in two coordinates, stretched by at most the octahedron's slope.
            assert!((0..3).all(|k| (back[k] - n[k]).abs() < 1e-4), "{n:?} {back:?}");
        }
        assert_eq!(normal([0x00, 0x80, 0x00, 0x80]), [0.0; 3]);
    }
}
