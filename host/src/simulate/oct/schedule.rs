//! What happens in which sweep: faults of the recording, saccades and a blink of the eye.

use super::random::{Purpose, Random};
use super::scene::OctScene;
use std::ops::Range;

/// What a sweep suffers from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Event {
    /// Nothing.
    None,
    /// Too much light.
    Saturated,
    /// No light at all: the source did not sweep.
    Missing,
    /// The camera stopped early.
    Short,
    /// The eye jumps, counted from 0.
    Saccade(usize),
    /// The lid hides the eye; the reference light stays.
    Blink,
}

impl Event {
    /// The verdict a reader of the recording should come to.
    pub fn verdict(self, scene: &OctScene) -> String {
        match self {
            Self::None => "ok".to_owned(),
            Self::Saturated => "saturated".to_owned(),
            Self::Missing => "missing".to_owned(),
            Self::Short => format!("short: {} of {} images", scene.short_images, scene.images),
            Self::Saccade(_) => "saccade".to_owned(),
            Self::Blink => "blink".to_owned(),
        }
    }

    /// Images of such a sweep in the file.
    pub fn images(self, scene: &OctScene) -> usize {
        if self == Self::Short { scene.short_images } else { scene.images }
    }
}

/// The event of each sweep. The first sweep has none.
pub fn events(scene: &OctScene) -> Vec<Event> {
    let mut events = vec![Event::None; scene.sweeps];
    add_episodes(scene, &mut events);
    let faults = [
        (Event::Short, scene.short_sweeps),
        (Event::Saturated, scene.saturated_sweeps),
        (Event::Missing, scene.missing_sweeps),
    ];
    let random = Random::new(scene.seed, Purpose::Faults);
    let faults = faults.into_iter().flat_map(|(event, count)| std::iter::repeat_n(event, count));
    for (i, fault) in faults.enumerate() {
        // A short sweep at the very end would move no other.
        let end = events.len() - usize::from(fault == Event::Short);
        let free: Vec<usize> = (1..end).filter(|&t| events[t] == Event::None).collect();
        let chosen = (random.uniform(i, 0) * free.len() as f64) as usize;
        if let Some(&t) = free.get(chosen) {
            events[t] = fault;
        }
    }
    events
}

/// Saccades and the blink take turns, each in the middle half of its share of the recording.
fn add_episodes(scene: &OctScene, events: &mut [Event]) {
    let random = Random::new(scene.seed, Purpose::Course);
    let count = scene.saccades + usize::from(scene.blink_sweeps > 0);
    let mut saccades = 0;
    for episode in 0..count {
        let share = (events.len() - 1) as f64 / count as f64;
        let start =
            1 + (share * (episode as f64 + random.between([0.25, 0.75], episode, 9))) as usize;
        if scene.blink_sweeps > 0 && episode == count / 2 {
            mark(events, start..start + scene.blink_sweeps, Event::Blink);
        } else {
            mark(events, start..start + 1, Event::Saccade(saccades));
            saccades += 1;
        }
    }
}

fn mark(events: &mut [Event], sweeps: Range<usize>, event: Event) {
    events.iter_mut().take(sweeps.end).skip(sweeps.start).for_each(|e| *e = event);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::oct::presets::Preset;

    #[test]
    fn every_fault_appears_once() {
        for seed in 0..50 {
            let scene = OctScene { seed, ..Preset::Faulty.scene() };
            let events = events(&scene);
            for fault in [Event::Saturated, Event::Missing, Event::Short] {
                assert_eq!(events.iter().filter(|&&e| e == fault).count(), 1);
            }
            assert_eq!(events[0], Event::None);
            assert_ne!(events[23], Event::Short);
        }
    }

    #[test]
    fn the_eye_jumps_twice_and_blinks_between() {
        for seed in 0..50 {
            let events = events(&OctScene { seed, ..Preset::Human.scene() });
            let special: Vec<Event> =
                events.iter().copied().filter(|&e| e != Event::None).collect();
            let blink = Event::Blink;
            assert_eq!(special, [Event::Saccade(0), blink, blink, Event::Saccade(1)]);
        }
    }

    #[test]
    fn verdicts_say_what_a_reader_says() {
        let scene = Preset::Faulty.scene();
        assert_eq!(Event::Short.verdict(&scene), "short: 37 of 256 images");
        assert_eq!((Event::Short.images(&scene), Event::Missing.images(&scene)), (37, 256));
    }
}
