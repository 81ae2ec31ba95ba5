//! KHR_animation_pointer, as far as it names what channels without it can name: where nodes stand, and their weights.

use super::schema::Channel;

/// What channels change without the extension.
const PROPERTIES: [&str; 4] = ["translation", "rotation", "scale", "weights"];

/// Rewrites `channel` to one without the extension, where that says the same. The path of others becomes their pointer, with
/// `{}` for its numbers, so that what is told of many is told once.
pub(super) fn rewrite(channel: &mut Channel) {
    let target = &mut channel.target;
    let Some(source) = target.extensions.pointer.take().filter(|_| target.path == "pointer") else { return };
    let node = source.pointer.strip_prefix("/nodes/").and_then(|rest| {
        let (node, property) = rest.split_once('/')?;
        PROPERTIES.contains(&property).then_some((node.parse().ok()?, property))
    });
    (target.node, target.path) = match node {
        Some((node, property)) => (Some(node), property.to_owned()),
        None => (None, template(&source.pointer)),
    };
}

/// `pointer` with `{}` in place of its numbers.
fn template(pointer: &str) -> String {
    let is_number = |part: &str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
    let parts = pointer.split('/').map(|part| if is_number(part) { "{}" } else { part });
    parts.collect::<Vec<_>>().join("/")
}
