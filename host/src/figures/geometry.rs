//! Points, rectangles, clipping and dashes: the little geometry a figure needs.

/// A place on the canvas: x to the right, y downwards.
pub type Point = (f64, f64);

/// An upright rectangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rect {
    /// Left edge.
    pub x: f64,
    /// Upper edge.
    pub y: f64,
    /// Width.
    pub w: f64,
    /// Height.
    pub h: f64,
}

impl Rect {
    /// A rectangle by its upper left corner and its size.
    #[must_use]
    pub fn new(x: f64, y: f64, w: f64, h: f64) -> Self {
        Self { x, y, w, h }
    }

    /// Right edge.
    #[must_use]
    pub fn right(&self) -> f64 {
        self.x + self.w
    }

    /// Lower edge.
    #[must_use]
    pub fn bottom(&self) -> f64 {
        self.y + self.h
    }

    /// Centre.
    #[must_use]
    pub fn center(&self) -> Point {
        (self.x + self.w / 2.0, self.y + self.h / 2.0)
    }

    /// The four corners, clockwise.
    #[must_use]
    pub fn corners(&self) -> [Point; 4] {
        let (r, b) = (self.right(), self.bottom());
        [(self.x, self.y), (r, self.y), (r, b), (self.x, b)]
    }

    /// The part of a straight line inside the rectangle (Liang and Barsky).
    #[must_use]
    pub fn clip(&self, from: Point, to: Point) -> Option<(Point, Point)> {
        let (dx, dy) = (to.0 - from.0, to.1 - from.1);
        let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
        let edges = [
            (-dx, from.0 - self.x),
            (dx, self.right() - from.0),
            (-dy, from.1 - self.y),
            (dy, self.bottom() - from.1),
        ];
        for (slope, room) in edges {
            if slope == 0.0 && room < 0.0 {
                return None;
            } else if slope < 0.0 {
                enter = enter.max(room / slope);
            } else if slope > 0.0 {
                leave = leave.min(room / slope);
            }
        }
        let at = |s: f64| (from.0 + s * dx, from.1 + s * dy);
        let (p, q) = (at(enter), at(leave));
        let finite = [p.0, p.1, q.0, q.1].iter().all(|v| v.is_finite());
        (enter <= leave && finite).then_some((p, q))
    }

    /// A curve inside the rectangle, in unbroken pieces; it breaks where a point is not finite.
    #[must_use]
    pub fn clip_curve(&self, points: &[Point]) -> Vec<Vec<Point>> {
        let mut pieces: Vec<Vec<Point>> = Vec::new();
        for pair in points.windows(2) {
            let Some((p, q)) = self.clip(pair[0], pair[1]) else {
                continue;
            };
            match pieces.last_mut() {
                Some(piece) if piece.last() == Some(&p) => piece.push(q),
                _ => pieces.push(vec![p, q]),
            }
        }
        pieces
    }
}

/// A line cut into dashes of length `on`, `off` apart.
#[must_use]
pub fn dashes(points: &[Point], (on, off): (f64, f64)) -> Vec<Vec<Point>> {
    let (on, off) = (on.max(0.1), off.max(0.1));
    let mut pieces = Vec::new();
    let mut piece: Vec<Point> = points.first().copied().into_iter().collect();
    let (mut drawing, mut left) = (true, on);
    for pair in points.windows(2) {
        let (mut from, to) = (pair[0], pair[1]);
        let mut length = (to.0 - from.0).hypot(to.1 - from.1);
        while length >= left {
            let s = left / length;
            from = (from.0 + s * (to.0 - from.0), from.1 + s * (to.1 - from.1));
            length -= left;
            piece.push(from);
            if drawing {
                pieces.push(std::mem::take(&mut piece));
            }
            drawing = !drawing;
            left = if drawing { on } else { off };
            piece = vec![from];
        }
        left -= length;
        piece.push(to);
    }
    if drawing && piece.len() > 1 && piece.first() != piece.last() {
        pieces.push(piece);
    }
    pieces
}

#[cfg(test)]
mod tests {
    use super::*;

    const AREA: Rect = Rect { x: 0.0, y: 0.0, w: 10.0, h: 10.0 };

    #[test]
    fn lines_end_at_the_edge() {
        let inside = AREA.clip((-5.0, 5.0), (15.0, 5.0));
        assert_eq!(inside, Some(((0.0, 5.0), (10.0, 5.0))));
        assert_eq!(AREA.clip((-5.0, 11.0), (15.0, 11.0)), None);
        assert_eq!(AREA.clip((f64::NAN, 1.0), (2.0, 2.0)), None);
        assert_eq!(AREA.clip((1.0, f64::INFINITY), (2.0, 2.0)), None);
    }

    #[test]
    fn curves_break_at_missing_values() {
        let curve = [(0.0, 1.0), (1.0, 1.0), (2.0, f64::NAN), (3.0, 1.0), (4.0, 2.0)];
        assert_eq!(AREA.clip_curve(&curve).len(), 2);
        assert!(AREA.clip_curve(&[]).is_empty());
    }

    #[test]
    fn dashes_cover_their_share() {
        let pieces = dashes(&[(0.0, 0.0), (4.0, 0.0), (10.0, 0.0)], (1.0, 1.0));
        assert_eq!(pieces.len(), 5);
        assert_eq!(pieces[0], [(0.0, 0.0), (1.0, 0.0)]);
        assert_eq!(dashes(&[], (1.0, 1.0)).len(), 0);
    }
}
