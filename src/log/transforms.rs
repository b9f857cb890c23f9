//! Where each frame sits: the transforms of `/tf_static` and `/tf` as one tree.

use std::collections::BTreeMap;

use glam::{DQuat, DVec3};

use crate::log::signals::{Header, Pose};

/// Longest step between two dynamic transforms that is interpolated across.
const MAX_GAP_NS: i64 = 500_000_000;

/// Changes below these are no motion: simulators compute mounts anew from world coordinates, and
/// what they round differs from message to message.
const STILL_M: f64 = 1e-3;
const STILL_RAD: f64 = 1e-4;

/// Longest chain of frames that is followed: a loop in the tree must not hang us.
const MAX_CHAIN: usize = 64;

impl Pose {
    pub const IDENTITY: Pose = Pose { position_m: DVec3::ZERO, rotation: DQuat::IDENTITY };

    /// A point of the child frame, in the parent frame.
    pub fn transform_point(&self, point_m: DVec3) -> DVec3 {
        self.rotation * point_m + self.position_m
    }

    /// `parent_from_child` of `child_from_grandchild` is `parent_from_grandchild`.
    pub fn then(&self, child_from_grandchild: &Pose) -> Pose {
        Pose {
            position_m: self.transform_point(child_from_grandchild.position_m),
            rotation: (self.rotation * child_from_grandchild.rotation).normalize(),
        }
    }

    /// `child_from_parent`.
    pub fn inverse(&self) -> Pose {
        let rotation = self.rotation.inverse();
        Pose { position_m: rotation * -self.position_m, rotation }
    }

    /// Whether two poses differ by no more than rounding.
    fn is_near(&self, other: &Pose) -> bool {
        self.position_m.distance(other.position_m) <= STILL_M
            && self.rotation.angle_between(other.rotation) <= STILL_RAD
    }

    /// Between two poses: straight for the position, the shorter way round for the rotation.
    pub fn interpolate(&self, other: &Pose, fraction: f64) -> Pose {
        Pose {
            position_m: self.position_m.lerp(other.position_m, fraction),
            rotation: self.rotation.slerp(other.rotation, fraction),
        }
    }
}

/// Transforms of one child frame.
#[derive(Clone, Debug)]
struct Link {
    parent: String,
    /// `parent_from_child` by stamp.
    poses: Vec<(i64, Pose)>,
    is_static: bool,
    /// All poses are the same but for rounding: a mount that was told again and again, or once, on a topic that
    /// does not say that it is static. It holds at all times.
    is_fixed: bool,
}

/// All transforms of a log.
#[derive(Clone, Debug, Default)]
pub struct TransformTree {
    links: BTreeMap<String, Link>,
}

impl TransformTree {
    /// Add one `parent_from_child`. A frame's parent is the first that it was given.
    pub fn insert(
        &mut self,
        header: &Header,
        child: &str,
        parent_from_child: Pose,
        is_static: bool,
    ) {
        let link = self.links.entry(child.to_string()).or_insert_with(|| Link {
            parent: header.frame_id.clone(),
            poses: Vec::new(),
            is_static,
            is_fixed: false,
        });
        if link.parent != header.frame_id {
            return;
        }
        match link.is_static {
            true if !link.poses.is_empty() => {}
            _ => link.poses.push((header.stamp_ns, parent_from_child)),
        }
    }

    /// How many poses each frame has so far, by child.
    pub fn lengths(&self) -> BTreeMap<String, usize> {
        self.links.iter().map(|(child, link)| (child.clone(), link.poses.len())).collect()
    }

    /// Cut off what was inserted after the tree had these lengths. What is static, or was told
    /// before and never again, holds in both parts.
    pub fn split_off(&mut self, at: &BTreeMap<String, usize>) -> TransformTree {
        let split = |(child, link): (&String, &mut Link)| {
            let mut later = link.clone();
            if !link.is_static {
                later.poses = link.poses.split_off(at.get(child).copied().unwrap_or_default());
                if later.poses.is_empty() && link.has_one_pose() {
                    later.poses = link.poses.clone();
                }
            }
            (child.clone(), later)
        };
        let mut later = TransformTree { links: self.links.iter_mut().map(split).collect() };
        later.links.retain(|_, link| !link.poses.is_empty());
        self.links.retain(|_, link| !link.poses.is_empty());
        later
    }

    /// Sort by stamp; call once after the last [`insert`](TransformTree::insert).
    pub fn finish(&mut self) {
        for link in self.links.values_mut() {
            link.poses.sort_by_key(|(stamp_ns, _)| *stamp_ns);
            link.is_fixed = link.has_one_pose();
        }
    }

    /// `target_from_source` at a time.
    ///
    /// # Errors
    ///
    /// A sentence that names both frames and what the tree has.
    pub fn lookup(&self, target: &str, source: &str, stamp_ns: i64) -> Result<Pose, String> {
        let missing = || {
            let have = self.links();
            let have = if have.is_empty() { "none".to_string() } else { have.join(", ") };
            format!("no transform from `{source}` to `{target}`; the log has {have}")
        };
        let up_from_source = self.chain(source, stamp_ns);
        let up_from_target = self.chain(target, stamp_ns);
        for (frame, frame_from_source) in &up_from_source {
            let common = up_from_target.iter().find(|(other, _)| other == frame);
            if let Some((_, frame_from_target)) = common {
                return Ok(frame_from_target.inverse().then(frame_from_source));
            }
        }
        Err(missing())
    }

    /// All links as `parent -> child`, by child.
    pub fn links(&self) -> Vec<String> {
        self.links.iter().map(|(child, link)| format!("{} -> {child}", link.parent)).collect()
    }

    /// Whether a frame is in the tree, as child or as parent.
    pub fn has(&self, frame: &str) -> bool {
        self.links.contains_key(frame) || self.links.values().any(|link| link.parent == frame)
    }

    /// Frames whose own link changes over time.
    pub fn moving(&self) -> impl Iterator<Item = &str> {
        let moving = self.links.iter().filter(|(_, link)| !link.is_static && !link.is_fixed);
        moving.map(|(child, _)| child.as_str())
    }

    /// Motion of a frame in the highest frame above it to which `/tf` leads at nine in ten of its
    /// stamps (the others are left out): that frame's name and the poses in it, by stamp. The
    /// stamps are those of the nearest link that moves. `None` if no link on the way is dynamic.
    pub fn motion<'a>(&'a self, frame: &str) -> Option<(&'a str, Vec<(i64, Pose)>)> {
        let dynamic = self.ancestry(frame).filter(|link| !link.is_static);
        let nearest = dynamic.min_by_key(|link| link.is_fixed)?;
        let mut stamps: Vec<i64> = nearest.poses.iter().map(|(stamp_ns, _)| *stamp_ns).collect();
        stamps.dedup();
        let worlds: Vec<&str> = self.ancestry(frame).map(|link| link.parent.as_str()).collect();
        worlds.into_iter().rev().find_map(|world| {
            let poses = stamps.iter().filter_map(|stamp_ns| {
                Some((*stamp_ns, self.lookup(world, frame, *stamp_ns).ok()?))
            });
            let poses: Vec<_> = poses.collect();
            (10 * poses.len() >= 9 * stamps.len()).then_some((world, poses))
        })
    }

    /// `target_from_source` of two frames that do not move against one another.
    pub fn rigid(&self, target: &str, source: &str) -> Option<Pose> {
        let rigid_part = |start| {
            let rigid = |link: &&Link| link.is_static || link.is_fixed;
            let rigid = self.ancestry(start).take_while(rigid);
            std::iter::once(start).chain(rigid.map(|link| link.parent.as_str())).collect::<Vec<_>>()
        };
        let (from_target, from_source) = (rigid_part(target), rigid_part(source));
        let meet = from_target.iter().any(|frame| from_source.contains(frame));
        // What does not move is the same at any time.
        meet.then(|| self.lookup(target, source, 0).ok()).flatten()
    }

    /// Links from a frame upwards.
    fn ancestry<'a>(&'a self, start: &str) -> impl Iterator<Item = &'a Link> + use<'a> {
        std::iter::successors(self.links.get(start), |link| self.links.get(&link.parent))
            .take(MAX_CHAIN)
    }

    /// The frame and all above it, each with `frame_from_start`.
    fn chain<'a>(&'a self, start: &'a str, stamp_ns: i64) -> Vec<(&'a str, Pose)> {
        let mut chain = vec![(start, Pose::IDENTITY)];
        while let Some(link) = self.links.get(chain[chain.len() - 1].0) {
            let Some(parent_from_child) = link.at(stamp_ns) else { break };
            let frame_from_start = parent_from_child.then(&chain[chain.len() - 1].1);
            chain.push((&link.parent, frame_from_start));
            if chain.len() > MAX_CHAIN {
                break;
            }
        }
        chain
    }
}

impl Link {
    fn has_one_pose(&self) -> bool {
        self.poses.iter().all(|(_, pose)| self.poses[0].1.is_near(pose))
    }

    fn at(&self, stamp_ns: i64) -> Option<Pose> {
        if self.is_static || self.is_fixed {
            return self.poses.first().map(|(_, pose)| *pose);
        }
        let after = self.poses.partition_point(|(stamp, _)| *stamp < stamp_ns);
        let next = self.poses.get(after);
        if let Some((stamp, pose)) = next.filter(|(stamp, _)| *stamp == stamp_ns) {
            debug_assert_eq!(*stamp, stamp_ns);
            return Some(*pose);
        }
        let (earlier_ns, earlier) = self.poses.get(after.checked_sub(1)?)?;
        let (later_ns, later) = next?;
        if later_ns - earlier_ns > MAX_GAP_NS {
            return None;
        }
        let fraction = (stamp_ns - earlier_ns) as f64 / (later_ns - earlier_ns) as f64;
        Some(earlier.interpolate(later, fraction))
    }
}
