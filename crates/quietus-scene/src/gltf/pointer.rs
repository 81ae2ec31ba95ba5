//! KHR_animation_pointer: what animations change, named by its place in the file.

use super::schema::Channel;

/// What channels change without the extension.
const PROPERTIES: [&str; 4] = ["translation", "rotation", "scale", "weights"];

/// Path of channels that change whether a node is seen; the extension alone can name that.
pub(super) const VISIBLE: &str = "extensions/KHR_node_visibility/visible";

/// Rewrites `channel` to one without the extension, where that says the same, or where it changes whether a node is seen.
pub(super) fn rewrite(channel: &mut Channel) {
    let target = &mut channel.target;
    let Some(source) = target.extensions.pointer.take().filter(|_| target.path == "pointer") else { return };
    let node = source.pointer.strip_prefix("/nodes/").and_then(|rest| {
        let (node, property) = rest.split_once('/')?;
        let known = PROPERTIES.contains(&property) || property == VISIBLE;
        known.then_some((node.parse().ok()?, property))
    });
    match node {
        Some((node, property)) => (target.node, target.path) = (Some(node), property.to_owned()),
        None => target.extensions.pointer = Some(source),
    }
}

/// `pointer` with `{}` in place of its numbers, so that what is told of many is told once.
pub(super) fn template(pointer: &str) -> String {
    let is_number = |part: &str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
    let parts = pointer.split('/').map(|part| if is_number(part) { "{}" } else { part });
    parts.collect::<Vec<_>>().join("/")
}
