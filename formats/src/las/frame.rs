//! How coordinates become the integers of a LAS file.

use crate::{Error, Result};

/// Scale and offset of the stored integers: coordinate = offset + integer · scale.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    /// Step between neighbouring coordinates, a power of ten, the same on all axes.
    pub scale: f64,
    /// Coordinates of the integers 0, whole numbers.
    pub offset: [f64; 3],
}

/// Steps that a frame may have, finest first.
const SCALES: [f64; 13] = [1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3];
/// Where nothing speaks against it: a tenth of a millimetre if the unit is the metre.
const USUAL: f64 = 1e-4;
/// A cloud is at least so many steps long, so that small units lose nothing.
const LEAST_STEPS: f64 = 1e5;
/// Most steps from the offset to the farthest point.
const MOST_STEPS: f64 = 2.1e9;

impl Frame {
    /// The frame for points within `[min, max]`: steps of 10⁻⁴, finer for clouds less than 10⁵ steps long, coarser where
    /// 32 bits do not suffice.
    ///
    /// # Errors
    /// [`Error::Invalid`]: bounds that are no numbers or too far apart.
    pub fn fitting(bounds: [[f64; 3]; 2]) -> Result<Self> {
        let [min, max] = bounds;
        let refused = |what: String| Error::Invalid { field: "bounds".into(), what };
        if min.iter().chain(&max).any(|v| !v.is_finite()) {
            return Err(refused("a coordinate is no finite number, which LAS cannot hold".into()));
        }
        let offset = min.map(f64::floor);
        let axes = || (0..3).map(|axis| max[axis] - min[axis]);
        let extent = axes().fold(0.0, f64::max);
        let span = (0..3).map(|axis| max[axis] - offset[axis]).fold(0.0, f64::max);
        // A length of 1 is 10⁵ steps of 10⁻⁵, whatever the division says.
        let is_fine = |scale: &f64| *scale <= USUAL && extent / *scale >= LEAST_STEPS - 0.5;
        let wanted = match SCALES.into_iter().rev().find(is_fine) {
            Some(scale) => scale,
            None if extent > 0.0 => SCALES[0],
            None => USUAL,
        };
        match SCALES.into_iter().find(|&scale| scale >= wanted && span / scale <= MOST_STEPS) {
            Some(scale) => Ok(Frame { scale, offset }),
            None => Err(refused(format!("{extent} from end to end is more than LAS can hold"))),
        }
    }

    /// The integer of a coordinate; `None` if it does not fit.
    #[inline]
    pub(super) fn quantize(&self, axis: usize, value: f64) -> Option<i32> {
        let steps = ((value - self.offset[axis]) / self.scale).round();
        let fits = steps >= f64::from(i32::MIN) && steps <= f64::from(i32::MAX);
        fits.then_some(steps as i32)
    }

    /// The coordinate of an integer.
    #[inline]
    pub(super) fn coordinate(&self, axis: usize, steps: i32) -> f64 {
        f64::from(steps) * self.scale + self.offset[axis]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(min: f64, max: f64) -> Frame {
        Frame::fitting([[min; 3], [max; 3]]).unwrap()
    }

    #[test]
    fn metres_get_tenths_of_millimetres() {
        for (min, max) in [(0.0, 10.0), (-7.5, 12.5), (500_000.1, 500_900.0), (0.0, 100_000.0)] {
            let frame = frame(min, max);
            assert_eq!((frame.scale, frame.offset), (1e-4, [f64::floor(min); 3]), "{min}..{max}");
        }
    }

    #[test]
    fn small_clouds_get_finer_and_large_ones_coarser_steps() {
        assert_eq!(frame(0.0, 1.0).scale, 1e-5);
        assert_eq!(frame(1.5, 1.501).scale, 1e-8);
        assert_eq!(frame(1.5, 1.500_001).scale, 1e-9);
        assert_eq!(frame(5.0, 5.0).scale, 1e-4);
        assert_eq!(frame(0.0, 1e6).scale, 1e-3);
        assert_eq!(frame(-1e10, 1e10).scale, 1e1);
        for (min, max) in [(0.0, 1.0), (1.5, 1.501), (0.0, 1e6), (-1e10, 1e10)] {
            let frame = frame(min, max);
            let there = frame.quantize(1, max).unwrap();
            assert!((frame.coordinate(1, there) - max).abs() <= 0.5001 * frame.scale);
        }
    }

    #[test]
    fn bounds_that_cannot_be_held_are_refused() {
        for (min, max) in [(f64::NAN, 1.0), (0.0, f64::INFINITY), (-1e15, 1e15)] {
            assert!(Frame::fitting([[min; 3], [max; 3]]).is_err());
        }
    }
}
