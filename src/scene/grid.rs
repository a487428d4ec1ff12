//! A raster of values.

use crate::geometry::Size;

/// Row-major raster, top row first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Grid<T> {
    size: Size,
    data: Vec<T>,
}

impl<T: Clone> Grid<T> {
    /// A raster of `size` filled with `value`.
    pub fn filled(size: Size, value: T) -> Self {
        Grid { size, data: vec![value; size.area()] }
    }
}

impl<T> Grid<T> {
    /// A raster over `data`; `None` if its length is not `size.area()`.
    pub fn from_vec(size: Size, data: Vec<T>) -> Option<Self> {
        (data.len() == size.area()).then_some(Grid { size, data })
    }

    /// Width and height.
    pub fn size(&self) -> Size {
        self.size
    }

    /// Columns.
    pub fn width(&self) -> usize {
        self.size.width as usize
    }

    /// Rows.
    pub fn height(&self) -> usize {
        self.size.height as usize
    }

    /// Position of column `x`, row `y` in [`Grid::data`].
    #[inline]
    pub fn index(&self, x: usize, y: usize) -> usize {
        y * self.width() + x
    }

    /// The value at column `x`, row `y`, or `None` outside.
    #[inline]
    pub fn get(&self, x: usize, y: usize) -> Option<&T> {
        let is_inside = x < self.width() && y < self.height();
        if is_inside { self.data.get(self.index(x, y)) } else { None }
    }

    /// Row `y`.
    #[inline]
    pub fn row(&self, y: usize) -> &[T] {
        &self.data[y * self.width()..(y + 1) * self.width()]
    }

    /// All values, row by row.
    #[inline]
    pub fn data(&self) -> &[T] {
        &self.data
    }

    /// All values, row by row.
    #[inline]
    pub fn data_mut(&mut self) -> &mut [T] {
        &mut self.data
    }

    /// The values, row by row.
    pub fn into_vec(self) -> Vec<T> {
        self.data
    }
}

impl<T> std::ops::Index<(usize, usize)> for Grid<T> {
    type Output = T;
    /// The value at (column, row).
    #[inline]
    fn index(&self, (x, y): (usize, usize)) -> &T {
        debug_assert!(x < self.width());
        &self.data[y * self.size.width as usize + x]
    }
}

impl<T> std::ops::IndexMut<(usize, usize)> for Grid<T> {
    #[inline]
    fn index_mut(&mut self, (x, y): (usize, usize)) -> &mut T {
        debug_assert!(x < self.width());
        &mut self.data[y * self.size.width as usize + x]
    }
}
