//! The directives that change the current transform.

use glam::DAffine3;
use glam::DVec3;

use super::arguments::{matrix, numbers, points, required, string};
use super::fault::{Fault, Place, Result, unknown};
use super::lexer::{Lexer, Token};
use super::parser::{DIRECTIVES, Parser};
use super::transform::{Moving, look_at};

impl Parser<'_> {
    /// The directives that change the current transform.
    pub(super) fn transform(&mut self, word: &str, place: Place, lexer: &mut Lexer<'_>) -> Result<()> {
        match word {
            "Identity" => self.set(Moving::IDENTITY),
            "Translate" => {
                let offset = DVec3::from_array(numbers(word, lexer)?);
                self.concat(DAffine3::from_translation(offset), place)?;
            }
            "Scale" => self.concat(DAffine3::from_scale(DVec3::from_array(numbers(word, lexer)?)), place)?,
            "Rotate" => self.rotate(place, lexer)?,
            "LookAt" => self.look_at(place, lexer)?,
            "Transform" => {
                let matrix = matrix(word, place, lexer)?;
                self.set(Moving::still(matrix));
            }
            "ConcatTransform" => {
                let matrix = matrix(word, place, lexer)?;
                self.concat(matrix, place)?;
            }
            "CoordinateSystem" => {
                let name = string(word, lexer)?;
                self.spaces.insert(name.into(), self.state.to_world);
            }
            "CoordSysTransform" => self.return_to(lexer)?,
            "ActiveTransform" => self.activate(lexer)?,
            "TransformTimes" => self.draft.times = Some(numbers::<2>(word, lexer)?.map(|time| time as f32)),
            "WorldEnd" => {
                self.context.warn(place, "WorldEnd is not part of pbrt-v4; it is passed over");
            }
            _ => return Err(Fault::invalid(place, unknown("directive", word, &DIRECTIVES))),
        }
        Ok(())
    }

    fn rotate(&mut self, place: Place, lexer: &mut Lexer<'_>) -> Result<()> {
        let [degrees, x, y, z] = numbers("Rotate", lexer)?;
        let axis = DVec3::new(x, y, z).try_normalize();
        let axis = axis.ok_or_else(|| Fault::invalid(place, "Rotate around an axis of length 0"))?;
        self.concat(DAffine3::from_axis_angle(axis, degrees.to_radians()), place)
    }

    fn look_at(&mut self, place: Place, lexer: &mut Lexer<'_>) -> Result<()> {
        let [eye, target, up] = points(numbers::<9>("LookAt", lexer)?);
        let message = "LookAt expects an eye, another point, and an up that is not between them";
        let view = look_at(eye, target, up).ok_or_else(|| Fault::invalid(place, message))?;
        self.concat(view, place)
    }

    /// To a space that has a name.
    fn return_to(&mut self, lexer: &mut Lexer<'_>) -> Result<()> {
        let at = lexer.place();
        let name = string("CoordSysTransform", lexer)?;
        let Some(space) = self.spaces.get(&*name) else {
            let known: Vec<&str> = self.spaces.keys().map(|name| &**name).collect();
            return Err(Fault::invalid(at, unknown("coordinate system", &name, &known)));
        };
        // As in pbrt, whatever the active time.
        self.state.to_world = *space;
        Ok(())
    }

    fn activate(&mut self, lexer: &mut Lexer<'_>) -> Result<()> {
        let (token, at) = required("ActiveTransform", lexer)?;
        self.state.active = match token {
            Token::Word("StartTime") => [true, false],
            Token::Word("EndTime") => [false, true],
            Token::Word("All") => [true, true],
            other => {
                let message = format!("{}, expected StartTime, EndTime or All", other.describe());
                return Err(Fault::syntax(at, message));
            }
        };
        Ok(())
    }

    fn set(&mut self, transform: Moving) {
        for time in 0..2 {
            if self.state.active[time] {
                self.state.to_world.0[time] = transform.0[time];
            }
        }
    }

    fn concat(&mut self, transform: DAffine3, place: Place) -> Result<()> {
        let joined = self.state.to_world.after(Moving::still(transform));
        self.set(joined);
        if joined.0.iter().all(DAffine3::is_finite) {
            return Ok(());
        }
        Err(Fault::invalid(place, "the transform overflows"))
    }

    /// Whether what stands here has no extent in some direction: exporters write such transforms around nothing.
    pub(super) fn is_flattened(&self) -> bool {
        !self.state.to_world.0.iter().all(|transform| transform.inverse().is_finite())
    }

    /// Says of `what` that it is flattened and left out, if it is.
    pub(super) fn left_out(&self, what: &str, place: Place) -> bool {
        let flattened = self.is_flattened();
        if flattened {
            let message = format!("{what} has no extent where its transform flattens space; it is left out");
            self.context.warn(place, message);
        }
        flattened
    }

    /// Refuses `what` under a transform that flattens space.
    pub(super) fn extended(&self, what: &str, place: Place) -> Result<()> {
        match self.is_flattened() {
            false => Ok(()),
            true => Err(Fault::invalid(place, format!("{what} under a transform that flattens space"))),
        }
    }
}
