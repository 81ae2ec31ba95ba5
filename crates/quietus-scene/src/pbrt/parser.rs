//! The directives: what each expects, and what it does to the graphics state and the draft of the scene. Those that
//! define things are in `defining`, those that change the current transform in `placing`.

use std::collections::HashMap;
use std::path::PathBuf;
use std::rc::Rc;

use super::arguments::string;
use super::draft::{Attributes, Draft, Entity, Group, MaterialRef, Style, Use};
use super::fault::{Context, Fault, Place, Result};
use super::images::Requests;
use super::lexer::{Lexer, Token};
use super::params::Params;
use super::spectrum::ColorSpace;
use super::transform::Moving;
use crate::file;

/// How deep files may include each other.
const MAX_DEPTH: usize = 64;
/// Most files that a scene may include, each counted as often as it is.
const MAX_INCLUDES: u32 = 1 << 16;
/// How deep attributes may be nested.
const MAX_NESTING: usize = 1 << 16;

/// Every directive, for messages.
pub(super) const DIRECTIVES: [&str; 41] = [
    "Accelerator",
    "ActiveTransform",
    "AreaLightSource",
    "Attribute",
    "AttributeBegin",
    "AttributeEnd",
    "Camera",
    "ColorSpace",
    "ConcatTransform",
    "CoordSysTransform",
    "CoordinateSystem",
    "Film",
    "Identity",
    "Import",
    "Include",
    "Integrator",
    "LightSource",
    "LookAt",
    "MakeNamedMaterial",
    "MakeNamedMedium",
    "Material",
    "MediumInterface",
    "NamedMaterial",
    "ObjectBegin",
    "ObjectEnd",
    "ObjectInstance",
    "Option",
    "PixelFilter",
    "ReverseOrientation",
    "Rotate",
    "Sampler",
    "Scale",
    "Shape",
    "Texture",
    "Transform",
    "TransformBegin",
    "TransformEnd",
    "TransformTimes",
    "Translate",
    "WorldBegin",
    "WorldEnd",
];

/// What `AttributeEnd` brings back.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub to_world: Moving,
    /// Which of the two times transforms apply to.
    pub active: [bool; 2],
    pub style: Rc<Style>,
    pub space: ColorSpace,
    pub attributes: Attributes,
}

/// What opened a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Block {
    Attribute,
    Transform,
    Object,
}

impl Block {
    fn words(self) -> [&'static str; 2] {
        match self {
            Block::Attribute => ["AttributeBegin", "AttributeEnd"],
            Block::Transform => ["TransformBegin", "TransformEnd"],
            Block::Object => ["ObjectBegin", "ObjectEnd"],
        }
    }
}

/// Reads directives into a [`Draft`].
#[derive(Debug)]
pub(super) struct Parser<'c> {
    pub context: &'c Context,
    pub draft: Draft,
    /// Pictures that area lights ask for.
    pub images: Requests,
    pub state: State,
    stack: Vec<(Block, State, Place)>,
    pub spaces: HashMap<Box<str>, Moving>,
    in_world: bool,
    /// The definition that shapes go to; 0 is the world.
    pub group: usize,
    including: Vec<PathBuf>,
    included: u32,
}

impl<'c> Parser<'c> {
    /// A parser of the scene at `path`.
    pub(super) fn new(context: &'c Context) -> Self {
        let nowhere = Place { file: 0, line: 1, column: 1 };
        let default = Entity {
            kind: "diffuse".into(),
            params: Params::new("material \"diffuse\"".to_owned(), nowhere, Vec::new(), Vec::new()),
        };
        let style =
            Style { material: MaterialRef::Index(0), light: None, media: [None, None], reversed: false };
        let state = State {
            to_world: Moving::IDENTITY,
            active: [true; 2],
            style: Rc::new(style),
            space: ColorSpace::Srgb,
            attributes: Attributes::default(),
        };
        let draft = Draft {
            materials: vec![default],
            groups: vec![Group { name: "world".into(), shapes: Vec::new() }],
            ..Draft::default()
        };
        Self {
            context,
            draft,
            images: Requests::default(),
            state,
            stack: Vec::new(),
            spaces: HashMap::new(),
            in_world: false,
            group: 0,
            including: Vec::new(),
            included: 0,
        }
    }

    /// Reads all of the scene: the content of the first file.
    pub(super) fn scene(&mut self, text: &[u8]) -> Result<()> {
        let mut lexer = Lexer::new(text, 0);
        self.directives(&mut lexer)?;
        if let Some((block, _, place)) = self.stack.last() {
            let [begin, end] = block.words();
            return Err(Fault::syntax(*place, format!("{begin} without {end}")));
        }
        if !self.in_world {
            let message = "the file ends before WorldBegin";
            return Err(Fault::syntax(lexer.place(), message));
        }
        Ok(())
    }

    /// Reads directives up to the end, or to where the last of them has led out of the text.
    fn directives(&mut self, lexer: &mut Lexer<'_>) -> Result<()> {
        while lexer.mark().is_none()
            && let Some((token, place)) = lexer.next()?
        {
            match token {
                Token::Word(word) => self.directive(word, place, lexer)?,
                other => {
                    let message = format!("{} where a directive is expected", other.describe());
                    return Err(Fault::syntax(place, message));
                }
            }
        }
        Ok(())
    }

    /// Directives that say how others belong together; the rest is in [`Self::define`].
    fn directive(&mut self, word: &str, place: Place, lexer: &mut Lexer<'_>) -> Result<()> {
        self.check_order(word, place)?;
        match word {
            "AttributeBegin" => self.begin(Block::Attribute, place),
            "AttributeEnd" => self.end(Block::Attribute, place),
            "TransformBegin" => self.begin(Block::Transform, place),
            "TransformEnd" => self.end(Block::Transform, place),
            "ObjectBegin" => self.object_begin(place, lexer),
            "ObjectEnd" => {
                self.end(Block::Object, place)?;
                self.group = 0;
                Ok(())
            }
            "ObjectInstance" => self.object_instance(place, lexer),
            "WorldBegin" => self.world_begin(place),
            "Include" | "Import" => self.include(word == "Import", place, lexer),
            _ => self.define(word, place, lexer),
        }
    }

    /// Refuses directives on the wrong side of `WorldBegin`.
    fn check_order(&self, word: &str, place: Place) -> Result<()> {
        let message = match word {
            "Camera" | "Film" | "PixelFilter" | "Sampler" | "Integrator" | "Accelerator"
            | "TransformTimes" | "Option" | "WorldBegin"
                if self.in_world =>
            {
                "belongs before WorldBegin"
            }
            "AttributeBegin" | "AttributeEnd" | "TransformBegin" | "TransformEnd" | "ObjectBegin"
            | "ObjectEnd" | "ObjectInstance" | "Shape" | "Material" | "NamedMaterial"
            | "MakeNamedMaterial" | "Texture" | "LightSource" | "AreaLightSource" | "ReverseOrientation"
            | "Import"
                if !self.in_world =>
            {
                "belongs after WorldBegin"
            }
            _ => return Ok(()),
        };
        Err(Fault::invalid(place, format!("{word} {message}")))
    }

    /// The style of what follows, to change it.
    pub(super) fn style(&mut self) -> &mut Style {
        Rc::make_mut(&mut self.state.style)
    }

    fn begin(&mut self, block: Block, place: Place) -> Result<()> {
        if self.stack.len() >= MAX_NESTING {
            return Err(Fault::unsupported(place, format!("nested deeper than {MAX_NESTING} blocks")));
        }
        self.stack.push((block, self.state.clone(), place));
        Ok(())
    }

    fn end(&mut self, block: Block, place: Place) -> Result<()> {
        let [begin, end] = block.words();
        match self.stack.pop() {
            None => Err(Fault::syntax(place, format!("{end} without {begin}"))),
            Some((open, ..)) if open != block => {
                Err(Fault::syntax(place, format!("{end} where {} is expected", open.words()[1])))
            }
            Some((Block::Transform, state, _)) => {
                self.state.to_world = state.to_world;
                self.state.active = state.active;
                Ok(())
            }
            Some((_, state, _)) => {
                self.state = state;
                Ok(())
            }
        }
    }

    fn world_begin(&mut self, place: Place) -> Result<()> {
        if let Some((block, ..)) = self.stack.last() {
            return Err(Fault::syntax(place, format!("WorldBegin where {} is expected", block.words()[1])));
        }
        self.in_world = true;
        self.state.to_world = Moving::IDENTITY;
        self.state.active = [true; 2];
        self.spaces.insert("world".into(), Moving::IDENTITY);
        Ok(())
    }

    fn object_begin(&mut self, place: Place, lexer: &mut Lexer<'_>) -> Result<()> {
        let name = string("ObjectBegin", lexer)?;
        if self.group != 0 {
            return Err(Fault::invalid(place, "ObjectBegin inside another object"));
        }
        if self.draft.groups[1..].iter().any(|group| *group.name == *name) {
            return Err(Fault::invalid(place, format!("object \"{name}\" is defined twice")));
        }
        self.begin(Block::Object, place)?;
        self.group = self.draft.groups.len();
        self.draft.groups.push(Group { name: name.into(), shapes: Vec::new() });
        Ok(())
    }

    fn object_instance(&mut self, place: Place, lexer: &mut Lexer<'_>) -> Result<()> {
        let name = string("ObjectInstance", lexer)?;
        if self.group != 0 {
            return Err(Fault::invalid(place, "ObjectInstance inside an object's definition"));
        }
        if !self.left_out("an object", place) {
            self.draft.uses.push(Use { name: name.into(), place, to_world: self.state.to_world });
        }
        Ok(())
    }

    /// Reads another file here; what an imported one does to the graphics state ends with it.
    fn include(&mut self, import: bool, place: Place, lexer: &mut Lexer<'_>) -> Result<()> {
        let name = string(if import { "Import" } else { "Include" }, lexer)?;
        let path = self.context.resolve(&name);
        self.included += 1;
        if self.including.len() >= MAX_DEPTH || self.included > MAX_INCLUDES {
            let message = format!(
                "expected at most {MAX_INCLUDES} included files, {MAX_DEPTH} of them inside each other"
            );
            return Err(Fault::unsupported(place, message));
        }
        if self.including.contains(&path) {
            return Err(Fault::invalid(place, format!("{name} includes itself")));
        }
        let text = file::read_unpacked(&path).map_err(|error| self.context.blame(place, error))?;
        let state = import.then(|| self.state.clone());
        let depth = self.stack.len();
        self.including.push(path.clone());
        let file = self.context.add_file(&path);
        let mut inner = if import { Lexer::new(&text, file) } else { Lexer::within(&text, file, lexer) };
        self.directives(&mut inner)?;
        if let Some(mark) = inner.mark() {
            lexer.resume(mark);
        }
        self.including.pop();
        if let Some(state) = state {
            if self.stack.len() != depth {
                let message = format!("{name} opens and closes different numbers of blocks");
                return Err(Fault::syntax(place, message));
            }
            self.state = state;
        }
        Ok(())
    }
}
