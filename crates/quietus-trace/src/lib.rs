//! The path tracer of Quietus: geometry, materials, lights, camera, sampler, integrator.
//!
//! One crate, so that the hot path inlines. It knows no threads, files or films: a caller hands over pixels
//! to sample ([`tile::PixelWork`]) and receives samples through [`tile::SampleSink`].

pub mod bsdf;
pub mod bvh;
pub mod camera;
pub mod desc;
pub mod filter;
pub mod frame;
pub mod geometry;
mod integrator;
mod interaction;
pub mod isa;
mod light;
pub mod material;
pub mod medium;
mod noise;
pub mod sampler;
pub mod scene;
#[cfg(test)]
mod testing;
pub mod texture;
pub mod tile;
pub mod view;
pub mod warp;
