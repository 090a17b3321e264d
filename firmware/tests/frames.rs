//! Whatever comes over the line, the board stays sane: nothing it was not told to do, and it goes
//! on listening.

mod desk;

use desk::{Desk, MS, small};
use phasewalk_firmware::compiled::Compiled;
use phasewalk_firmware::frame;
use phasewalk_firmware::message::{Command, Reply, Request, State};

/// Frames of each property test.
const FRAMES: usize = 100_000;

/// SplitMix64, from a recorded seed.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }
}

/// A frame that would do something if it were taken.
fn request(random: &mut Random, hash: u32) -> Vec<u8> {
    let plan = Compiled::new(&small()).unwrap();
    let commands = [
        Command::Start,
        Command::Arm(hash),
        Command::Confirm { hash, nonce: random.next() as u32 },
        Command::Commit(hash),
        Command::Upload(plan.bytes()),
        Command::Status,
        Command::Clear,
    ];
    let command = commands[random.below(commands.len())];
    let number = random.next() as u8;
    frame::encode(&Request { number, command }).unwrap().to_vec()
}

/// Corrupt, truncated, or random bytes; always ended by a zero so that the next frame counts.
fn damaged(random: &mut Random, hash: u32) -> Vec<u8> {
    let mut bytes = request(random, hash);
    match random.below(4) {
        0 => {
            let bit = random.below(8 * (bytes.len() - 1));
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
        1 => {
            let keep = random.below(bytes.len() - 1);
            bytes.truncate(keep);
            bytes.push(0);
        }
        2 => {
            bytes = (0..random.below(200)).map(|_| random.next() as u8).collect();
            bytes.push(0);
        }
        _ => {
            // Two bytes changed places.
            let at = random.below(bytes.len() - 2);
            bytes.swap(at, at + 1);
        }
    }
    bytes
}

#[test]
fn damaged_frames_do_nothing() {
    let mut random = Random(20_190_811);
    let mut desk = Desk::new();
    let hash = desk.load(&small());
    for frames in 0..FRAMES {
        let bytes = damaged(&mut random, hash);
        desk.send(&bytes);
        if frames % 1000 == 999 {
            desk.run(5 * MS);
            // A frame may be damaged and yet another valid request: a status, say. But nothing of
            // this arms, for that takes a nonce.
            assert!(matches!(desk.device.state(), State::Idle | State::Asked));
        }
    }
    desk.run(20 * MS);
    // One in 65,536 damaged frames passes a CRC of 16 bits; two changed bits or swapped bytes never.
    let reply = desk.ask(Command::Hello);
    assert!(matches!(reply, Reply::Hello(_)), "it still listens: {reply:?}");
    assert_eq!(desk.status().plan, hash);
}

#[test]
fn duplicated_and_reordered_requests_never_start_a_run() {
    let mut random = Random(11_748);
    let mut desk = Desk::new();
    let hash = desk.load(&small());
    for frames in 0..FRAMES {
        let bytes = request(&mut random, hash);
        for _ in 0..=random.below(2) {
            desk.send(&bytes);
        }
        if frames % 1000 == 999 {
            desk.run(5 * MS);
            assert_ne!(desk.device.state(), State::Running);
            assert_ne!(desk.device.state(), State::Armed);
        }
    }
    desk.run(20 * MS);
    assert!(matches!(desk.ask(Command::Hello), Reply::Hello(_)));
    assert_eq!(desk.status().plan, hash);
}

#[test]
fn a_run_goes_on_under_a_flood_of_rubbish() {
    let mut random = Random(641);
    let mut desk = Desk::new();
    desk.start(&small());
    let mut sent = 0;
    while desk.device.state() == State::Running {
        let bytes = damaged(&mut random, 1);
        sent += 1;
        desk.send(&bytes);
        desk.pass();
    }
    assert_eq!(desk.device.state(), State::Finished, "after {sent} frames");
    desk.run(20 * MS);
    assert_eq!(desk.made().len(), 22);
}
