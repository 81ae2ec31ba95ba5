//! The directives: what each expects, and what it does to the graphics state and the draft of the scene. Those that
//! change the current transform are in `placing`.

use std::collections::HashMap;
use std::path::PathBuf;
use std::rc::Rc;

use super::arguments::string;
use super::draft::{Attributes, Draft, Entity, Group, MaterialRef, Medium, Style, TextureEntity, Use};
use super::fault::{Context, Fault, Place, Result, unknown};
use super::images::Requests;
use super::lexer::{Lexer, Token};
use super::params::{self, Params};
use super::spectrum::ColorSpace;
use super::transform::Moving;
use super::{light, shape};
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
    style: Rc<Style>,
    space: ColorSpace,
    attributes: Attributes,
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
    group: usize,
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
            "Shape" => self.shape(place, lexer),
            "Material" => {
                let entity = self.entity("material", place, lexer, |a| &a.material)?;
                self.style().material = MaterialRef::Index(self.draft.materials.len());
                self.draft.materials.push(entity);
                Ok(())
            }
            "NamedMaterial" => {
                let name = string(word, lexer)?;
                self.style().material = MaterialRef::Named(name.into(), place);
                Ok(())
            }
            "MakeNamedMaterial" => self.make_material(place, lexer),
            "MakeNamedMedium" => self.make_medium(place, lexer),
            "MediumInterface" => self.medium_interface(place, lexer),
            "Texture" => self.texture(place, lexer),
            "LightSource" => {
                let entity = self.entity("light", place, lexer, |a| &a.light)?;
                if !self.left_out("a light", place) {
                    self.draft.lights.push((entity, self.state.to_world));
                }
                Ok(())
            }
            "AreaLightSource" => {
                let entity = self.entity("area light", place, lexer, |a| &a.light)?;
                let light = light::area(&entity, self.context, &mut self.images)?;
                self.style().light = Some(Rc::new(light));
                Ok(())
            }
            "Camera" => self.camera(place, lexer),
            "ReverseOrientation" => {
                self.style().reversed ^= true;
                Ok(())
            }
            "ColorSpace" => {
                let at = lexer.place();
                let name = string(word, lexer)?;
                self.state.space = ColorSpace::named(&name)
                    .ok_or_else(|| Fault::invalid(at, unknown("colour space", &name, &ColorSpace::NAMES)))?;
                Ok(())
            }
            "Attribute" => self.attribute(lexer),
            "Option" => self.option(place, lexer),
            "Film" | "PixelFilter" | "Sampler" | "Integrator" | "Accelerator" => {
                self.choice(word, place, lexer)
            }
            _ => self.transform(word, place, lexer),
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
    fn style(&mut self) -> &mut Style {
        Rc::make_mut(&mut self.state.style)
    }

    /// A type in quotation marks and parameters.
    fn entity(
        &self,
        what: &str,
        place: Place,
        lexer: &mut Lexer<'_>,
        inherited: impl Fn(&Attributes) -> &Vec<Rc<Vec<params::Param>>>,
    ) -> Result<Entity> {
        let kind = string(what, lexer)?;
        let list = params::parse(lexer, self.context, self.state.space)?;
        let inherited = inherited(&self.state.attributes).clone();
        let params = Params::new(format!("{what} \"{kind}\""), place, list, inherited);
        Ok(Entity { kind: kind.into(), params })
    }

    /// One of the directives that say how to draw; a later one replaces an earlier one.
    fn choice(&mut self, word: &str, place: Place, lexer: &mut Lexer<'_>) -> Result<()> {
        let what = match word {
            "Film" => "film",
            "PixelFilter" => "filter",
            "Sampler" => "sampler",
            "Integrator" => "integrator",
            _ => "accelerator",
        };
        let kind = string(what, lexer)?;
        let list = params::parse(lexer, self.context, self.state.space)?;
        let params = Params::new(format!("{what} \"{kind}\""), place, list, Vec::new());
        let entity = Some(Entity { kind: kind.into(), params });
        match word {
            "Film" => self.draft.film = entity,
            "PixelFilter" => self.draft.filter = entity,
            "Sampler" => self.draft.sampler = entity,
            "Integrator" => self.draft.integrator = entity,
            // This renderer has one way to find what a ray hits.
            _ => {}
        }
        Ok(())
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

    fn shape(&mut self, place: Place, lexer: &mut Lexer<'_>) -> Result<()> {
        let entity = self.entity("shape", place, lexer, |a| &a.shape)?;
        let to_world = self.state.to_world;
        let style = Rc::clone(&self.state.style);
        let shape = shape::read(&entity, to_world, style, self.context, &mut self.draft.ply)?;
        if !self.left_out("a shape", place) {
            self.draft.groups[self.group].shapes.extend(shape);
        }
        Ok(())
    }

    fn make_material(&mut self, place: Place, lexer: &mut Lexer<'_>) -> Result<()> {
        let name = string("MakeNamedMaterial", lexer)?;
        let list = params::parse(lexer, self.context, self.state.space)?;
        let inherited = self.state.attributes.material.clone();
        let params = Params::new(format!("material \"{name}\""), place, list, inherited);
        let kind = match params.string("type")? {
            Some(kind) => kind.into(),
            None => return Err(Fault::invalid(place, format!("material \"{name}\" has no \"string type\""))),
        };
        if self.draft.named_materials.insert(name.clone().into(), self.draft.materials.len()).is_some() {
            return Err(Fault::invalid(place, format!("material \"{name}\" is made twice")));
        }
        self.draft.materials.push(Entity { kind, params });
        Ok(())
    }

    fn make_medium(&mut self, place: Place, lexer: &mut Lexer<'_>) -> Result<()> {
        let name = string("MakeNamedMedium", lexer)?;
        let list = params::parse(lexer, self.context, self.state.space)?;
        let inherited = self.state.attributes.medium.clone();
        let params = Params::new(format!("medium \"{name}\""), place, list, inherited);
        let kind = match params.string("type")? {
            Some(kind) => kind.into(),
            None => return Err(Fault::invalid(place, format!("medium \"{name}\" has no \"string type\""))),
        };
        if self.draft.media.iter().any(|(other, ..)| **other == *name) {
            return Err(Fault::invalid(place, format!("medium \"{name}\" is made twice")));
        }
        self.extended("MakeNamedMedium", place)?;
        self.draft.media.push((name.into(), Entity { kind, params }, self.state.to_world));
        Ok(())
    }

    fn medium_interface(&mut self, place: Place, lexer: &mut Lexer<'_>) -> Result<()> {
        let inside = string("MediumInterface", lexer)?;
        let outside = match lexer.peek()? {
            Some(Token::Quoted(_)) => string("MediumInterface", lexer)?,
            _ => inside.clone(),
        };
        let medium = |name: String| -> Option<Medium> { (!name.is_empty()).then(|| (name.into(), place)) };
        self.style().media = [medium(inside), medium(outside)];
        Ok(())
    }

    fn texture(&mut self, place: Place, lexer: &mut Lexer<'_>) -> Result<()> {
        let name = string("Texture", lexer)?;
        let at = lexer.place();
        let values = string("Texture", lexer)?;
        let color = match &*values {
            "float" => false,
            "spectrum" => true,
            _ => {
                let message = unknown("type of texture values", &values, &["float", "spectrum"]);
                return Err(Fault::invalid(at, message));
            }
        };
        let entity = self.entity("texture", place, lexer, |a| &a.texture)?;
        if self.draft.textures.iter().any(|other| *other.name == *name && other.color == color) {
            return Err(Fault::invalid(place, format!("{values} texture \"{name}\" is defined twice")));
        }
        self.extended("Texture", place)?;
        let to_world = self.state.to_world;
        self.draft.textures.push(TextureEntity { name: name.into(), color, entity, to_world });
        Ok(())
    }

    fn camera(&mut self, place: Place, lexer: &mut Lexer<'_>) -> Result<()> {
        let kind = string("camera", lexer)?;
        let list = params::parse(lexer, self.context, self.state.space)?;
        let params = Params::new(format!("camera \"{kind}\""), place, list, Vec::new());
        let entity = Entity { kind: kind.into(), params };
        self.extended("Camera", place)?;
        let to_world = self.state.to_world.inverse();
        self.spaces.insert("camera".into(), to_world);
        let medium = self.state.style.media[1].clone();
        self.draft.camera = Some((entity, to_world, medium));
        Ok(())
    }

    fn attribute(&mut self, lexer: &mut Lexer<'_>) -> Result<()> {
        let at = lexer.place();
        let target = string("Attribute", lexer)?;
        let list = Rc::new(params::parse(lexer, self.context, self.state.space)?);
        let attributes = &mut self.state.attributes;
        let of_kind = match &*target {
            "shape" => &mut attributes.shape,
            "light" => &mut attributes.light,
            "material" => &mut attributes.material,
            "medium" => &mut attributes.medium,
            "texture" => &mut attributes.texture,
            _ => {
                let known = ["shape", "light", "material", "medium", "texture"];
                return Err(Fault::invalid(at, unknown("kind of attribute", &target, &known)));
            }
        };
        of_kind.push(list);
        Ok(())
    }

    /// Options of pbrt itself. Those that change the picture on purpose are said to be left out.
    fn option(&mut self, place: Place, lexer: &mut Lexer<'_>) -> Result<()> {
        let list = params::parse(lexer, self.context, self.state.space)?;
        let params = Params::new("Option".to_owned(), place, list, Vec::new());
        for name in ["forcediffuse", "disablepixeljitter", "disabletexturefiltering"] {
            if params.boolean(name, false)? {
                let message = format!("option \"{name}\" is not followed");
                self.context.warn(params.place_of(name), message);
            }
        }
        params.ignore(&[
            "disablewavelengthjitter",
            "displacementedgescale",
            "msereferenceimage",
            "msereferenceout",
            "pixelstats",
            "rendercoordsys",
            "seed",
            "wavefront",
        ]);
        params.finish()
    }
}
