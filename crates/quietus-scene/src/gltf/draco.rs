//! Meshes compressed by Draco: KHR_draco_mesh_compression.

use draco_core::{DecodeLimits, DecoderBuffer, MeshDecoder};

use super::document::Document;
use super::schema;
use crate::error::SceneError;
use crate::limit;

/// Largest decoded vertex data of one primitive, in bytes; as many bytes may be taken for its triangles.
const MAX_DECODED_BYTES: u64 = limit(1 << 31);

/// Largest number of vertices and of triangles of one primitive.
const MAX_ELEMENTS: u64 = limit(1 << 27);

/// A primitive, decoded.
pub(super) struct Compressed {
    mesh: draco_core::Mesh,
    /// Draco's numbers of the attributes, by their names.
    attributes: schema::Attributes,
    /// Of the extension object.
    place: String,
}

impl Compressed {
    /// Decodes what `source`, the extension of the primitive at `place`, refers to.
    pub(super) fn decode(
        document: &Document<'_>,
        source: &schema::Draco,
        place: &str,
    ) -> Result<Self, SceneError> {
        let place = format!("{place}.extensions.KHR_draco_mesh_compression");
        let (bytes, _) = document.view(source.buffer_view, &format!("{place}.bufferView"))?;
        let mut limits = DecodeLimits::default();
        (limits.max_points, limits.max_faces) = (MAX_ELEMENTS, MAX_ELEMENTS);
        limits.max_decoded_bytes = MAX_DECODED_BYTES;
        let mut mesh = draco_core::Mesh::new();
        let mut buffer = DecoderBuffer::new(bytes).with_limits(limits);
        MeshDecoder::new()
            .decode(&mut buffer, &mut mesh)
            .map_err(|error| document.invalid(&place, format!("is not a whole Draco mesh: {error}")))?;
        Ok(Self { mesh, attributes: source.attributes.clone(), place })
    }

    /// Number of vertices.
    pub(super) fn vertices(&self) -> usize {
        self.mesh.num_points()
    }

    /// Corners of the triangles, every three of them.
    pub(super) fn corners(&self) -> Vec<u32> {
        self.mesh.faces().iter().flatten().map(|point| point.0).collect()
    }

    /// Attribute `name` of all vertices as finite vectors, if it is compressed: missing components keep the value of
    /// `fill`. Integers are normalized where accessor `accessor`, which describes the same data, says so.
    pub(super) fn read<const N: usize>(
        &self,
        document: &Document<'_>,
        name: &str,
        accessor: usize,
        fill: [f32; N],
    ) -> Result<Option<Vec<[f32; N]>>, SceneError> {
        let Some(&id) = self.attributes.get(name) else { return Ok(None) };
        let place = format!("{}.attributes.{name}", self.place);
        let attribute = u32::try_from(id).ok().and_then(|id| self.mesh.attribute_by_unique_id(id));
        let Some(attribute) = attribute else {
            return Err(document.invalid(&place, format!("is {id}, which the compressed mesh does not have")));
        };
        let (width, count) = (usize::from(attribute.num_components()), self.vertices());
        if width == 0 || width > N {
            let message = format!("has {width} components in the compressed mesh, expected at most {N}");
            return Err(document.invalid(&place, message));
        }
        document.claim_geometry(&place, (count * (width + N) * size_of::<f32>()) as u64)?;
        let unit = document.unit(accessor, &place)?;
        let numbers = attribute.read_f32s(count, width);
        let elements = numbers.chunks_exact(width).map(|numbers| {
            let mut element = fill;
            element.iter_mut().zip(numbers).for_each(|(to, value)| *to = value / unit);
            if unit > 1.0 { element.map(|value| value.max(-1.0)) } else { element }
        });
        let elements: Vec<_> = elements.collect();
        match elements.iter().flatten().all(|value| value.is_finite()) {
            true => Ok(Some(elements)),
            false => Err(document.invalid(&place, "expected finite numbers")),
        }
    }
}
