//! What a state is of: settings and scene, told apart by name and content.

use serde::{Deserialize, Serialize};

/// What decides the picture.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    /// Names and values of settings.
    pub settings: Vec<(String, String)>,
    /// The files of the scene.
    pub files: Vec<FileMark>,
}

/// A file of a scene.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct FileMark {
    /// Its name without folders, as a scene may be moved.
    pub name: String,
    /// Its size.
    pub bytes: u64,
    /// 128 bits of XXH3 over its content, in hexadecimal.
    pub hash: String,
}

/// Values longer than that, in bytes, tell nobody anything.
const LONGEST: usize = 60;

impl Identity {
    /// The value of a setting.
    pub fn setting(&self, name: &str) -> Option<&str> {
        self.settings.iter().find(|(other, _)| other == name).map(|(_, value)| value.as_str())
    }

    /// What of the settings and the scene is not the same in `now`, in words; settings of which `may_differ` holds are
    /// left out.
    pub fn differences(&self, now: &Self, may_differ: impl Fn(&str) -> bool) -> Vec<String> {
        let mut names: Vec<&str> =
            self.settings.iter().chain(&now.settings).map(|(name, _)| name.as_str()).collect();
        names.sort_unstable();
        names.dedup();
        names.retain(|name| !may_differ(name));
        let mut differences = Vec::new();
        for name in names {
            let [then, now] = [self, now].map(|identity| identity.setting(name));
            if then != now {
                let [then, now] = [then, now].map(|value| value.unwrap_or("not set"));
                differences.push(match then.len().max(now.len()) <= LONGEST {
                    true => format!("{name} was {then}, is {now}"),
                    false => format!("{name} is another one"),
                });
            }
        }
        differences.extend(self.changed_files(now));
        differences
    }

    fn changed_files(&self, now: &Self) -> Vec<String> {
        let mut differences = Vec::new();
        for file in now.files.iter().filter(|file| !self.files.contains(file)) {
            let was_there = self.files.iter().any(|other| other.name == file.name);
            let what = if was_there { "has another content" } else { "was not part of the scene" };
            differences.push(format!("the file {} {what}", file.name));
        }
        for file in &self.files {
            if !now.files.iter().any(|other| other.name == file.name) {
                differences.push(format!("the file {} is no part of the scene any more", file.name));
            }
        }
        differences
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn identity(settings: &[(&str, &str)], files: &[(&str, &str)]) -> Identity {
        let file = |&(name, hash): &(&str, &str)| FileMark { name: name.into(), bytes: 1, hash: hash.into() };
        Identity {
            settings: settings.iter().map(|&(name, value)| (name.into(), value.into())).collect(),
            files: files.iter().map(file).collect(),
        }
    }

    #[test]
    fn what_differs_is_named() {
        let then =
            identity(&[("seed", "1"), ("threads", "2"), ("env", "a")], &[("a.glb", "1"), ("b.png", "2")]);
        let now = identity(&[("threads", "4"), ("seed", "3")], &[("a.glb", "9"), ("c.png", "2")]);
        assert_eq!(then.differences(&then, |_| false), Vec::<String>::new());
        let expected = [
            "env was a, is not set",
            "seed was 1, is 3",
            "the file a.glb has another content",
            "the file c.png was not part of the scene",
            "the file b.png is no part of the scene any more",
        ];
        assert_eq!(then.differences(&now, |name| name == "threads"), expected);
    }
}
