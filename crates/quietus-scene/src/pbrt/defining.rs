//! The directives that define things: shapes, materials, media, textures, lights, the camera, and how to draw.

use std::rc::Rc;

use super::arguments::string;
use super::draft::{Attributes, Entity, MaterialRef, Medium, TextureEntity};
use super::fault::{Fault, Place, Result, unknown};
use super::lexer::{Lexer, Token};
use super::params::{self, Params};
use super::parser::Parser;
use super::spectrum::ColorSpace;
use super::{light, shape};

impl Parser<'_> {
    /// The directives that define things; the rest is in [`Self::transform`].
    pub(super) fn define(&mut self, word: &str, place: Place, lexer: &mut Lexer<'_>) -> Result<()> {
        match word {
            "Shape" => self.shape(place, lexer),
            "Material" => self.material(place, lexer),
            "NamedMaterial" => {
                let name = string(word, lexer)?;
                self.style().material = MaterialRef::Named(name.into(), place);
                Ok(())
            }
            "MakeNamedMaterial" => self.make_material(place, lexer),
            "MakeNamedMedium" => self.make_medium(place, lexer),
            "MediumInterface" => self.medium_interface(place, lexer),
            "Texture" => self.texture(place, lexer),
            "LightSource" => self.light(place, lexer),
            "AreaLightSource" => self.area_light(place, lexer),
            "Camera" => self.camera(place, lexer),
            "ReverseOrientation" => {
                self.style().reversed ^= true;
                Ok(())
            }
            "ColorSpace" => self.color_space(lexer),
            "Attribute" => self.attribute(lexer),
            "Option" => self.option(place, lexer),
            "Film" | "PixelFilter" | "Sampler" | "Integrator" | "Accelerator" => {
                self.choice(word, place, lexer)
            }
            _ => self.transform(word, place, lexer),
        }
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

    fn material(&mut self, place: Place, lexer: &mut Lexer<'_>) -> Result<()> {
        let entity = self.entity("material", place, lexer, |a| &a.material)?;
        self.style().material = MaterialRef::Index(self.draft.materials.len());
        self.draft.materials.push(entity);
        Ok(())
    }

    /// The name of a material or medium that is made, and what it is: its type is among its parameters.
    fn made(
        &self,
        (word, what): (&str, &str),
        place: Place,
        lexer: &mut Lexer<'_>,
        inherited: impl Fn(&Attributes) -> &Vec<Rc<Vec<params::Param>>>,
    ) -> Result<(Box<str>, Entity)> {
        let name = string(word, lexer)?;
        let list = params::parse(lexer, self.context, self.state.space)?;
        let inherited = inherited(&self.state.attributes).clone();
        let params = Params::new(format!("{what} \"{name}\""), place, list, inherited);
        let kind = params.string("type")?.map(Into::into);
        let kind =
            kind.ok_or_else(|| Fault::invalid(place, format!("{what} \"{name}\" has no \"string type\"")))?;
        Ok((name.into(), Entity { kind, params }))
    }

    fn make_material(&mut self, place: Place, lexer: &mut Lexer<'_>) -> Result<()> {
        let (name, entity) = self.made(("MakeNamedMaterial", "material"), place, lexer, |a| &a.material)?;
        if self.draft.named_materials.insert(name.clone(), self.draft.materials.len()).is_some() {
            return Err(Fault::invalid(place, format!("material \"{name}\" is made twice")));
        }
        self.draft.materials.push(entity);
        Ok(())
    }

    fn make_medium(&mut self, place: Place, lexer: &mut Lexer<'_>) -> Result<()> {
        let (name, entity) = self.made(("MakeNamedMedium", "medium"), place, lexer, |a| &a.medium)?;
        if self.draft.media.iter().any(|(other, ..)| **other == *name) {
            return Err(Fault::invalid(place, format!("medium \"{name}\" is made twice")));
        }
        self.extended("MakeNamedMedium", place)?;
        self.draft.media.push((name, entity, self.state.to_world));
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

    fn light(&mut self, place: Place, lexer: &mut Lexer<'_>) -> Result<()> {
        let entity = self.entity("light", place, lexer, |a| &a.light)?;
        if !self.left_out("a light", place) {
            self.draft.lights.push((entity, self.state.to_world));
        }
        Ok(())
    }

    fn area_light(&mut self, place: Place, lexer: &mut Lexer<'_>) -> Result<()> {
        let entity = self.entity("area light", place, lexer, |a| &a.light)?;
        let light = light::area(&entity, self.context, &mut self.images)?;
        self.style().light = Some(Rc::new(light));
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

    fn color_space(&mut self, lexer: &mut Lexer<'_>) -> Result<()> {
        let at = lexer.place();
        let name = string("ColorSpace", lexer)?;
        self.state.space = ColorSpace::named(&name)
            .ok_or_else(|| Fault::invalid(at, unknown("colour space", &name, &ColorSpace::NAMES)))?;
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
