//! The homographies of a plane to sixteen sources at a time, a lane each.

use super::Lanes;
use crate::stereo::level::Transfers;
use crate::stereo::plane::InversePlane;
use crate::stereo::tile::{CENTRE, Homographies, Quadratic, TILE_W, WIN_H, WIN_W};

/// Half the extent of the window.
pub(super) const HALF: (f32, f32) = ((WIN_W as f32 - 1.0) / 2.0, (WIN_H as f32 - 1.0) / 2.0);
/// Change of the depth ratio within the window up to which a warp is quadratic: the error, in pixels, is below a window's
/// half extent times the square of this.
pub(super) const SMOOTH: f32 = 0.03;
/// Steps per pixel of fixed-point source pixels.
pub(super) const FIXED: f32 = 65_536.0;
/// Added to the extent of footprints for rounding, in pixels.
const SLACK: f32 = 0.02;
/// Columns of the window in one vector, of two rows.
pub(super) const COLUMNS: usize = TILE_W / 2;

impl Quadratic {
    /// The low end of its footprint in pixels is `low`.
    #[inline(always)]
    fn fill<L: Lanes>(&mut self, at: L, (dx, dy): (L, L), (z_dx, z_dy): (L, L), low: L) {
        let fixed = L::splat(FIXED);
        let square = L::splat(4.0) * dy * z_dy;
        let mixed = L::splat(2.0) * (dx * z_dy + dy * z_dx);
        (at * fixed).store(&mut self.at);
        (dx * fixed).store(&mut self.dx);
        (dy * fixed).store(&mut self.dy);
        ((L::splat(2.0) * dy - square) * fixed).store(&mut self.step);
        (mixed * fixed).store(&mut self.step_dx);
        (square * fixed).store(&mut self.step_dy);
        L::store_words((L::splat(-8.0 * FIXED) * dy * z_dy).truncated(), &mut self.bend);
        ((at + low) * fixed).store(&mut self.corner);
    }
}

impl Homographies {
    /// Those of plane `p` of the tile at `(x0, y0)`, anchored at its centre.
    #[inline(always)]
    pub(super) fn fill<L: Lanes>(&mut self, to: &Transfers, (x0, y0): (i32, i32), p: InversePlane) {
        let x = L::splat(x0 as f32 + CENTRE.0);
        let y = L::splat(y0 as f32 + CENTRE.1);
        let (w, wx, wy) = (L::splat(p.w), L::splat(p.wx), L::splat(p.wy));
        let (mut c, mut dx, mut dy) = ([w; 3], [w; 3], [w; 3]);
        for i in 0..3 {
            let a: [L; 3] = [L::load(&to.a[i][0]), L::load(&to.a[i][1]), L::load(&to.a[i][2])];
            let b = L::load(&to.b[i]);
            c[i] = a[0] * x + a[1] * y + a[2] + b * w;
            dx[i] = a[0] + b * wx;
            dy[i] = a[1] + b * wy;
        }
        let (one, zero, near) = (L::splat(1.0), L::splat(0.0), L::splat(1e-6));
        let in_front = near.lt(c[2]);
        let r = one / near.max(c[2]);
        let (z_dx, z_dy) = (dx[2] * r, dy[2] * r);
        let (z_far_x, z_far_y) = (z_dx.abs(), z_dy.abs());
        let bend = z_far_x * L::splat(HALF.0) + z_far_y * L::splat(HALF.1);
        let mut inside = L::both(in_front, bend.lt(L::splat(SMOOTH)));
        let mut extents = [zero; 2];
        for i in 0..2 {
            let at = c[i] * r;
            let dx = (dx[i] - at * dx[2]) * r;
            let dy = (dy[i] - at * dy[2]) * r;
            at.store(&mut self.at[i]);
            dx.store(&mut self.dx[i]);
            dy.store(&mut self.dy[i]);
            L::store_words(at.max(zero).min(L::splat(32_767.0)).truncated(), &mut self.pixel[i]);
            let far = dx.abs() * L::splat(HALF.0) + dy.abs() * L::splat(HALF.1);
            let reach = far * L::splat(1.0 + 2.0 * SMOOTH) + L::splat(SLACK);
            let last = L::load(&to.last[i]);
            inside = L::both(inside, L::both(one.le(at - reach), (at + reach).le(last)));
            let (low, high) = footprint(dx, dy, bend, (far * z_far_x, far * z_far_y));
            extents[i] = high - low + L::splat(SLACK);
            self.quadratic[i].fill(at, (dx, dy), (z_dx, z_dy), low - L::splat(0.5 * SLACK));
        }
        z_dx.store(&mut self.z_dx);
        z_dy.store(&mut self.z_dy);
        L::select(in_front, one, zero).store(&mut self.in_front);
        L::select(inside, one, zero).store(&mut self.well_inside);
        if L::LOOKUP {
            let [columns, rows] = extents;
            let eight = L::both(columns.le(L::splat(14.0)), rows.lt(L::splat(6.0)));
            let rows = L::select(rows.lt(L::splat(2.0)), L::splat(4.0), L::splat(8.0));
            L::select(eight, rows, zero).store(&mut self.rows);
        }
    }
}

/// How far source pixels of eight columns of two rows can be from the first one, one coordinate: the lowest and the highest.
/// `bend` is the largest change of the depth ratio within the window, `far` the largest distance from the centre times its
/// change by column and by row.
#[inline(always)]
fn footprint<L: Lanes>(dx: L, dy: L, bend: L, far: (L, L)) -> (L, L) {
    let (zero, reach) = (L::splat(0.0), L::splat((COLUMNS - 1) as f32));
    let (bend_x, bend_y) = (dx.abs() * bend + far.0, dy.abs() * bend + far.1);
    let low = reach * (dx - bend_x).min(zero) + (dy - bend_y).min(zero);
    let high = reach * (dx + bend_x).max(zero) + (dy + bend_y).max(zero);
    (low, high)
}
