//! Which light to ask.

use super::bounds::{LightBounds, Receiver};
use super::distribution::AliasTable;
use super::tree::LightTree;
use crate::isa::Isa;

/// Bounds of the share of samples that goes to lights infinitely far away where there are others too.
///
/// The share follows the irradiance both kinds may cause, which does not know what hides them: a sky outside of a
/// window is far stronger than the lamps inside, and yet they may be all that is seen. Within these bounds a wrong
/// guess costs a factor of two against half and half.
const INFINITE_SHARE: [f32; 2] = [0.25, 0.75];

/// How to choose among lights that stand in the scene.
#[derive(Clone, Debug, Default)]
enum Local {
    /// There are none that shine.
    #[default]
    None,
    /// One lamp, in at most two pieces, and nothing else: by power, since no receiver sees one piece much better than
    /// the other.
    Lamp(AliasTable),
    /// By what each can do for the receiver.
    Tree(LightTree),
}

/// Chooses among the lights for a receiver.
#[derive(Clone, Debug, Default)]
pub(crate) struct LightSelector {
    choice: Local,
    /// How many lights stand in the scene: numbers from here on are infinitely far away.
    local: u32,
    infinite: AliasTable,
    /// Irradiance that the infinitely far lights cause together.
    irradiance: f32,
}

impl Local {
    /// `alone` says whether there is nothing infinitely far away, which a lamp would have to be weighed against.
    fn new(lights: &[LightBounds], alone: bool) -> Self {
        let shining = lights.iter().filter(|light| light.power > 0.0 && light.power.is_finite());
        let one_lamp = match *shining.collect::<Vec<_>>() {
            [_] => true,
            [a, b] => {
                let both = a.union(b);
                // The halves of a rectangle: they face the same way, and together they are hardly larger than one.
                both.theta_o < SAME_WAY && both.radius2() < 2.0 * a.radius2().min(b.radius2())
            }
            _ => false,
        };
        match LightTree::new(lights) {
            None => Self::None,
            Some(_) if one_lamp && alone => {
                let power = |light: &LightBounds| f64::from(light.power);
                let clean = |power: f64| if power.is_finite() { power.max(0.0) } else { 0.0 };
                Self::Lamp(AliasTable::new(&lights.iter().map(power).map(clean).collect::<Vec<_>>()))
            }
            Some(tree) => Self::Tree(tree),
        }
    }
}

/// Half angle, in radians, of a cone whose directions count as one.
const SAME_WAY: f32 = 0.01;

impl LightSelector {
    /// A selector over `local` lights, followed by `infinite` ones, given the irradiance they cause; numbers that
    /// are negative or not finite count as 0.
    pub(super) fn new(local: &[LightBounds], infinite: &[f32]) -> Self {
        let clean: Vec<f64> =
            infinite.iter().map(|&w| if w.is_finite() { f64::from(w.max(0.0)) } else { 0.0 }).collect();
        let irradiance = clean.iter().sum::<f64>() as f32;
        Self {
            choice: Local::new(local, irradiance <= 0.0),
            local: local.len() as u32,
            infinite: AliasTable::new(&clean),
            irradiance,
        }
    }

    /// The share of samples for lights infinitely far away.
    #[inline(always)]
    fn infinite_share<I: Isa>(&self, isa: I, receiver: &Receiver) -> f32 {
        match &self.choice {
            Local::None => 1.0,
            Local::Lamp(_) => 0.0,
            Local::Tree(_) if self.irradiance <= 0.0 => 0.0,
            Local::Tree(tree) => {
                let local = tree.irradiance(isa, receiver);
                if local <= 0.0 {
                    return 1.0;
                }
                let [least, most] = INFINITE_SHARE;
                let share = self.irradiance / (self.irradiance + local);
                // Also for infinity over infinity.
                if share > least { share.min(most) } else { least }
            }
        }
    }

    /// A light and the probability of choosing it, for `u` in `[0, 1)`; none where none shines.
    #[inline(always)]
    pub(crate) fn sample<I: Isa>(&self, isa: I, receiver: &Receiver, u: f32) -> Option<(u32, f32)> {
        let share = self.infinite_share(isa, receiver);
        if u < share {
            let (light, probability) = self.infinite.sample(u / share)?;
            return Some((self.local + light, share * probability));
        }
        let rest = ((u - share) / (1.0 - share)).min(1.0 - f32::EPSILON / 2.0);
        let (light, probability) = match &self.choice {
            Local::None => return None,
            Local::Lamp(table) => table.sample(rest)?,
            Local::Tree(tree) => tree.sample(isa, receiver, rest)?,
        };
        Some((light, (1.0 - share) * probability))
    }

    /// The probability with which [`Self::sample`] chooses `light`.
    #[inline(always)]
    pub(crate) fn probability<I: Isa>(&self, isa: I, receiver: &Receiver, light: u32) -> f32 {
        let share = self.infinite_share(isa, receiver);
        if light >= self.local {
            return share * self.infinite.probability(light - self.local);
        }
        let probability = match &self.choice {
            Local::None => 0.0,
            Local::Lamp(table) => table.probability(light),
            Local::Tree(tree) => tree.probability(isa, receiver, light),
        };
        (1.0 - share) * probability
    }
}
