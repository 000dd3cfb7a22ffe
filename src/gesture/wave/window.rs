//! A window of recent values in one slice, without allocation after construction.

/// The last values pushed, oldest first, contiguous in memory.
///
/// Holds at most `capacity` values; the oldest give way. A push costs a copy of the window once
/// every `capacity` pushes.
#[derive(Clone, Debug)]
pub(super) struct Window<T> {
    data: Vec<T>,
    start: usize,
    capacity: usize,
}

impl<T: Copy> Window<T> {
    /// An empty window.
    pub fn new(capacity: usize) -> Self {
        Self {
            data: Vec::with_capacity(2 * capacity.max(1)),
            start: 0,
            capacity: capacity.max(1),
        }
    }

    /// Appends a value.
    pub fn push(&mut self, value: T) {
        if self.data.len() == 2 * self.capacity {
            self.data.copy_within(self.start.., 0);
            self.data.truncate(self.data.len() - self.start);
            self.start = 0;
        }
        self.data.push(value);
        if self.data.len() - self.start > self.capacity {
            self.start += 1;
        }
    }

    /// Forgets the oldest values for which `old` holds.
    pub fn forget(&mut self, old: impl Fn(&T) -> bool) {
        while self.data.get(self.start).is_some_and(&old) {
            self.start += 1;
        }
    }

    /// The values, oldest first.
    pub fn values(&self) -> &[T] {
        &self.data[self.start..]
    }

    /// Forgets everything.
    pub fn clear(&mut self) {
        self.data.clear();
        self.start = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_window_keeps_the_newest_in_order_and_never_grows() {
        let mut window = Window::new(5);
        let room = window.data.capacity();
        for value in 0..100 {
            window.push(value);
            let expected: Vec<i32> = ((value - 4).max(0)..=value).collect();
            assert_eq!(window.values(), expected);
        }
        window.forget(|value| *value < 98);
        assert_eq!(window.values(), [98, 99]);
        assert_eq!(window.data.capacity(), room);
    }
}
