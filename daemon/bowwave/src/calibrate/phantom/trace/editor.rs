//! Outlines under somebody's hands, as a state machine: gestures in, outlines out. No window and no clock.

use bowwave_calibration::{POLYGONS_MOST, polygon};
use bowwave_core::own_ship::Phantom;
use glam::DVec2;

/// A corner so near to the picture's border is meant to lie on it, pixels.
const SNAP_PX: f64 = 3.0;
/// Corners nearer to each other are one, pixels.
const APART_PX: f64 = 0.5;
/// Most corners of a part, as the calibration file has it.
const CORNERS_MOST: usize = 64;

/// What somebody does, whatever with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Gesture {
    /// Points at a place of the picture, pixels.
    Point(DVec2),
    /// Moves the cursor by so many pixels.
    Move(DVec2),
    /// Sets a corner at the cursor.
    Corner,
    /// Takes the last corner back; with none, the part that was closed last is open again.
    Back,
    /// Closes the open part.
    Close,
    /// The part in hand recoils, or does no more.
    Recoils,
    /// Takes the next part in hand.
    Next,
    /// Leaves the part in hand out, or keeps it again.
    LeaveOut,
    /// Ends without a result.
    Cancel,
    /// Ends with what is kept.
    Save,
}

/// Where a part comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Origin {
    /// The calibration has it.
    Calibrated,
    /// The recording tells it.
    Found,
    /// Traced here.
    Traced,
}

/// A closed part.
#[derive(Clone, Debug, PartialEq)]
pub struct Part {
    /// Its outline.
    pub phantom: Phantom,
    /// Where it comes from.
    pub origin: Origin,
    /// Whether it is part of the result.
    pub is_kept: bool,
}

/// Outlines that are being traced.
#[derive(Clone, Debug)]
pub struct Editor {
    size: (u32, u32),
    parts: Vec<Part>,
    /// Corners of the open part.
    open: Vec<DVec2>,
    /// Whether the open part recoils.
    open_recoils: bool,
    cursor: DVec2,
    in_hand: Option<usize>,
    message: String,
    end: Option<End>,
}

/// How it ended.
#[derive(Clone, Debug, PartialEq)]
pub enum End {
    /// Nothing is to be written.
    Cancelled,
    /// These are.
    Saved(Vec<Phantom>),
}

impl Editor {
    /// Over a picture of `size` pixels, with the parts of the calibration and those that a recording tells. What is told is left out at first
    /// where the calibration has parts: both would be the same.
    pub fn new(size: (u32, u32), calibrated: &[Phantom], found: &[Phantom]) -> Self {
        let part = |phantom: &Phantom, origin, is_kept| Part { phantom: phantom.clone(), origin, is_kept };
        let is_new = calibrated.is_empty();
        let mut parts: Vec<Part> = calibrated.iter().map(|p| part(p, Origin::Calibrated, true)).collect();
        parts.extend(found.iter().map(|p| part(p, Origin::Found, is_new)));
        Self {
            size,
            in_hand: (!parts.is_empty()).then_some(0),
            parts,
            open: Vec::new(),
            open_recoils: false,
            cursor: DVec2::new(f64::from(size.0), f64::from(size.1)) / 2.0,
            message: String::new(),
            end: None,
        }
    }

    /// All closed parts.
    pub fn parts(&self) -> &[Part] {
        &self.parts
    }

    /// Corners of the open part, and whether it recoils.
    pub fn open(&self) -> (&[DVec2], bool) {
        (&self.open, self.open_recoils)
    }

    /// Where the next corner would be, pixels.
    pub fn cursor(&self) -> DVec2 {
        self.cursor
    }

    /// Number of the closed part in hand; none while one is open.
    pub fn in_hand(&self) -> Option<usize> {
        self.in_hand.filter(|_| self.open.is_empty())
    }

    /// What the last gesture led to; may be empty.
    pub fn message(&self) -> &str {
        &self.message
    }

    /// How it ended; none while it goes on.
    pub fn end(&self) -> Option<&End> {
        self.end.as_ref()
    }

    /// Takes a gesture; after the end none.
    pub fn take(&mut self, gesture: Gesture) {
        if self.end.is_some() {
            return;
        }
        let said = match gesture {
            // Pointing goes on all the time: what was said before stays.
            Gesture::Point(place) => return self.point(place),
            Gesture::Move(by) => return self.point(self.cursor + by),
            Gesture::Corner => self.corner(),
            Gesture::Back => self.back(),
            Gesture::Close => self.close(),
            Gesture::Recoils => self.recoils(),
            Gesture::Next => self.next(),
            Gesture::LeaveOut => self.leave_out(),
            Gesture::Cancel => {
                self.end = Some(End::Cancelled);
                Ok(String::new())
            }
            Gesture::Save => self.save(),
        };
        self.message = said.unwrap_or_else(|refused| refused);
    }

    fn point(&mut self, place: DVec2) {
        if place.is_finite() {
            self.cursor = place.clamp(DVec2::ZERO, self.far_corner());
        }
    }

    fn far_corner(&self) -> DVec2 {
        DVec2::new(f64::from(self.size.0), f64::from(self.size.1))
    }

    fn corner(&mut self) -> Result<String, String> {
        if self.open.is_empty() && self.parts.len() >= POLYGONS_MOST {
            return Err(format!(
                "A calibration takes {POLYGONS_MOST} parts: leave some out, save, and begin again"
            ));
        }
        if self.open.len() >= CORNERS_MOST {
            return Err(format!(
                "A part has {CORNERS_MOST} corners at most: close it and trace another that overlaps"
            ));
        }
        let far = self.far_corner();
        let snapped = |at: f64, far: f64| match at {
            at if at <= SNAP_PX => 0.0,
            at if at >= far - SNAP_PX => far,
            at => at,
        };
        let corner = DVec2::new(snapped(self.cursor.x, far.x), snapped(self.cursor.y, far.y));
        if self.open.last().is_some_and(|last| last.distance(corner) < APART_PX) {
            return Err("The last corner is there already".to_owned());
        }
        self.open.push(corner);
        Ok(String::new())
    }

    fn back(&mut self) -> Result<String, String> {
        if self.open.pop().is_some() {
            return Ok(String::new());
        }
        let last = self.parts.pop_if(|part| part.origin == Origin::Traced);
        let part = last.ok_or_else(|| "There is no corner to take back".to_owned())?;
        self.open = part.phantom.outline().to_vec();
        self.open_recoils = part.phantom.recoils;
        self.in_hand = (!self.parts.is_empty()).then_some(0);
        Ok(format!("{} is open again", part.phantom.name))
    }

    fn close(&mut self) -> Result<String, String> {
        if self.open.is_empty() {
            return Err("Set corners along the edge of a part first".to_owned());
        }
        polygon::triangles(&self.open).map_err(|refused| sentence(&refused.to_string()))?;
        let name = self.free_name();
        let phantom = Phantom::new(name.as_str(), std::mem::take(&mut self.open), self.size)
            .recoiling(std::mem::take(&mut self.open_recoils));
        self.in_hand = Some(self.parts.len());
        self.parts.push(Part { phantom, origin: Origin::Traced, is_kept: true });
        Ok(format!("{name} is closed"))
    }

    /// The first name that no part has.
    fn free_name(&self) -> String {
        let is_free = |name: &String| self.parts.iter().all(|part| part.phantom.name != *name);
        (1..).map(|number| format!("traced {number}")).find(is_free).unwrap_or_default()
    }

    fn recoils(&mut self) -> Result<String, String> {
        if !self.open.is_empty() {
            self.open_recoils = !self.open_recoils;
            return Ok(String::new());
        }
        let part = self.part_in_hand()?;
        let recoils = !part.phantom.recoils;
        part.phantom = part.phantom.clone().recoiling(recoils);
        Ok(String::new())
    }

    fn part_in_hand(&mut self) -> Result<&mut Part, String> {
        let part = self.in_hand.and_then(|i| self.parts.get_mut(i));
        part.ok_or_else(|| "There is no part yet: set corners along its edge".to_owned())
    }

    fn next(&mut self) -> Result<String, String> {
        if !self.open.is_empty() {
            return Err("Close the part first, or take its corners back".to_owned());
        }
        self.part_in_hand()?;
        self.in_hand = self.in_hand.map(|i| (i + 1) % self.parts.len());
        Ok(String::new())
    }

    fn leave_out(&mut self) -> Result<String, String> {
        if !self.open.is_empty() {
            return Err("Close the part first, or take its corners back".to_owned());
        }
        let part = self.part_in_hand()?;
        part.is_kept = !part.is_kept;
        Ok(String::new())
    }

    fn save(&mut self) -> Result<String, String> {
        if !self.open.is_empty() {
            return Err("A part is open: close it, or take its corners back".to_owned());
        }
        let kept = self.parts.iter().filter(|part| part.is_kept).map(|part| part.phantom.clone());
        self.end = Some(End::Saved(kept.collect()));
        Ok(String::new())
    }
}

/// Begins with a capital letter.
fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (u32, u32) = (640, 360);

    fn part(name: &str) -> Phantom {
        let corners = [[100.0, 200.0], [150.0, 200.0], [150.0, 360.0], [100.0, 360.0]];
        Phantom::new(name, corners.map(DVec2::from_array).to_vec(), SIZE)
    }

    fn clicks(editor: &mut Editor, corners: &[[f64; 2]]) {
        for corner in corners {
            editor.take(Gesture::Point(DVec2::from_array(*corner)));
            editor.take(Gesture::Corner);
        }
    }

    fn saved(editor: &mut Editor) -> Vec<Phantom> {
        editor.take(Gesture::Save);
        match editor.end() {
            Some(End::Saved(parts)) => parts.clone(),
            other => panic!("{other:?}: {}", editor.message()),
        }
    }

    #[test]
    fn a_part_is_traced_by_mouse_and_by_keys_alike() {
        let corners = [[300.0, 200.0], [340.0, 200.0], [380.0, 358.5], [260.0, 359.0]];
        let mut mouse = Editor::new(SIZE, &[], &[]);
        clicks(&mut mouse, &corners);
        mouse.take(Gesture::Recoils);
        mouse.take(Gesture::Close);
        let mut keys = Editor::new(SIZE, &[], &[]);
        for corner in corners {
            let by = DVec2::from_array(corner) - keys.cursor();
            keys.take(Gesture::Move(by));
            keys.take(Gesture::Corner);
        }
        keys.take(Gesture::Close);
        keys.take(Gesture::Recoils);
        let traced = saved(&mut mouse);
        assert_eq!(traced, saved(&mut keys));
        // What is near the border lies on it.
        let expected = [[300.0, 200.0], [340.0, 200.0], [380.0, 360.0], [260.0, 360.0]];
        assert_eq!(
            traced,
            [Phantom::new("traced 1", expected.map(DVec2::from_array).to_vec(), SIZE).recoiling(true)]
        );
    }

    #[test]
    fn corners_and_parts_are_taken_back() {
        let mut editor = Editor::new(SIZE, &[], &[]);
        editor.take(Gesture::Back);
        assert_eq!(editor.message(), "There is no corner to take back");
        clicks(&mut editor, &[[10.0, 10.0], [50.0, 10.0], [50.0, 50.0], [70.0, 90.0]]);
        editor.take(Gesture::Back);
        editor.take(Gesture::Close);
        assert_eq!(editor.parts()[0].phantom.outline().len(), 3);
        editor.take(Gesture::Back);
        assert_eq!((editor.parts().len(), editor.open().0.len()), (0, 3));
        for _ in 0..3 {
            editor.take(Gesture::Back);
        }
        assert_eq!(saved(&mut editor), []);
    }

    #[test]
    fn parts_of_calibration_and_recording_are_kept_or_left_out() {
        let mut editor = Editor::new(SIZE, &[part("barrel")], &[part("part 1")]);
        let kept = |editor: &Editor| editor.parts().iter().map(|p| p.is_kept).collect::<Vec<_>>();
        assert_eq!((kept(&editor), editor.in_hand()), (vec![true, false], Some(0)));
        editor.take(Gesture::LeaveOut);
        editor.take(Gesture::Next);
        editor.take(Gesture::LeaveOut);
        editor.take(Gesture::Recoils);
        assert_eq!((kept(&editor), editor.in_hand()), (vec![false, true], Some(1)));
        editor.take(Gesture::Next);
        assert_eq!(editor.in_hand(), Some(0));
        assert_eq!(saved(&mut editor), [part("part 1").recoiling(true)]);
        // Without parts in the calibration those that the recording tells are kept.
        assert_eq!(saved(&mut Editor::new(SIZE, &[], &[part("part 1")])), [part("part 1")]);
    }

    #[test]
    fn what_cannot_be_is_refused_with_what_to_do() {
        let mut editor = Editor::new(SIZE, &[], &[]);
        let said = |editor: &mut Editor, gesture| {
            editor.take(gesture);
            editor.message().to_owned()
        };
        for gesture in [Gesture::Recoils, Gesture::Next, Gesture::LeaveOut] {
            assert!(said(&mut editor, gesture).contains("no part yet"), "{gesture:?}");
        }
        assert!(said(&mut editor, Gesture::Close).starts_with("Set corners"));
        clicks(&mut editor, &[[10.0, 10.0], [90.0, 90.0]]);
        assert!(said(&mut editor, Gesture::Corner).contains("there already"));
        assert!(said(&mut editor, Gesture::Close).contains("three or more"));
        clicks(&mut editor, &[[90.0, 10.0], [10.0, 90.0]]);
        let crossing = "The outline crosses itself: the edge from corner 1 to 2 meets that from 3 to 4";
        assert!(said(&mut editor, Gesture::Close).starts_with(crossing), "{}", editor.message());
        assert!(said(&mut editor, Gesture::Save).contains("A part is open") && editor.end().is_none());
        for gesture in [Gesture::Next, Gesture::LeaveOut] {
            assert!(said(&mut editor, gesture).contains("Close the part first"));
        }
        let zigzag: Vec<[f64; 2]> =
            (0..70).map(|i| [100.0 + f64::from(i) * 4.0, 100.0 + f64::from(i % 2)]).collect();
        clicks(&mut editor, &zigzag);
        assert_eq!((editor.open().0.len(), editor.message().contains("64 corners at most")), (64, true));
        editor.take(Gesture::Cancel);
        assert_eq!(editor.end(), Some(&End::Cancelled));
        editor.take(Gesture::Save);
        assert_eq!(editor.end(), Some(&End::Cancelled));
    }

    #[test]
    fn no_more_parts_than_a_calibration_takes() {
        let many = vec![part("many"); POLYGONS_MOST];
        let mut editor = Editor::new(SIZE, &many, &[]);
        clicks(&mut editor, &[[10.0, 10.0]]);
        assert!(editor.open().0.is_empty() && editor.message().contains("32 parts"), "{}", editor.message());
    }

    #[test]
    fn the_cursor_stays_in_the_picture() {
        let mut editor = Editor::new(SIZE, &[], &[]);
        editor.take(Gesture::Move(DVec2::new(-1e9, 1e9)));
        assert_eq!(editor.cursor(), DVec2::new(0.0, 360.0));
        editor.take(Gesture::Point(DVec2::NAN));
        assert_eq!(editor.cursor(), DVec2::new(0.0, 360.0));
    }
}
