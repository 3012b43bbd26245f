//! How to read the generated JSON schema: types, words, variants, limits and units.

use crate::node::number;
use serde_json::Value as Json;

/// The schema of a value that is present: the alternative `null` is dropped.
pub(crate) fn present(schema: &Json) -> &Json {
    let options = schema["anyOf"].as_array().map(Vec::as_slice).unwrap_or_default();
    if options.iter().any(|o| o["type"] == "null") {
        options.iter().find(|o| o["type"] != "null").unwrap_or(schema)
    } else {
        schema
    }
}

/// The type of a value that is present.
pub(crate) fn kind(schema: &Json) -> &str {
    match &schema["type"] {
        Json::Array(types) => types.iter().filter_map(Json::as_str).find(|t| *t != "null").unwrap_or_default(),
        single => single.as_str().unwrap_or_default(),
    }
}

/// Whether a table may hold any keys.
pub(crate) fn is_free(schema: &Json) -> bool {
    schema["format"] == "free"
}

/// The words of a schema that allows words only.
pub(crate) fn words(schema: &Json) -> Option<Vec<&str>> {
    schema["oneOf"].as_array()?.iter().map(|option| option["const"].as_str()).collect()
}

/// The key that distinguishes a variant from the others, and the variant's word.
pub(crate) fn tag(variant: &Json) -> Option<(&str, &str)> {
    let properties = variant["properties"].as_object()?;
    properties.iter().find_map(|(name, schema)| Some((name.as_str(), schema["const"].as_str()?)))
}

/// The length and the items of an array, in words: `of 2 numbers`.
pub(crate) fn lengths(schema: &Json) -> String {
    let items = match kind(&schema["items"]) {
        "array" => format!("arrays, each {}", lengths(&schema["items"])),
        "number" => "numbers".to_owned(),
        "integer" => "whole numbers".to_owned(),
        "string" if words(&schema["items"]).is_none() => "strings".to_owned(),
        _ if words(&schema["items"]).is_some() => "words".to_owned(),
        _ => "tables".to_owned(),
    };
    match (schema["minItems"].as_u64(), schema["maxItems"].as_u64()) {
        (Some(min), Some(max)) if min == max => format!("of {min} {items}"),
        (Some(min), Some(max)) => format!("of {min} to {max} {items}"),
        (_, Some(max)) => format!("of at most {max} {items}"),
        _ => format!("of {items}"),
    }
}

/// The unit in the ending of a key's name. Indices behind the name are skipped.
pub(crate) fn unit(path: &str) -> Option<&'static str> {
    const ENDINGS: [(&str, &str); 9] = [
        ("_bps", "bit/s"),
        ("_ppm", "10⁻⁶"),
        ("_db", "dB"),
        ("_mps2", "m/s²"),
        ("_mps", "m/s"),
        ("_per_s", "1/s"),
        ("_rad", "rad"),
        ("_s", "s"),
        ("_m", "m"),
    ];
    let name = path.rsplit('.').find(|step| step.parse::<usize>().is_err())?;
    ENDINGS.iter().find(|(ending, _)| name.ends_with(ending)).map(|(_, unit)| *unit)
}

/// The limits of a number in words: `from 0 to 10`.
pub(crate) fn range(schema: &Json) -> String {
    let limit = |name: &str| schema[name].as_f64();
    let max = schema["maximum"].as_i64().map(|max| max.to_string()).or_else(|| limit("maximum").map(number));
    match (limit("minimum").map(number), limit("exclusiveMinimum").map(number), max) {
        (_, Some(min), Some(max)) => format!("above {min}, at most {max}"),
        (Some(min), _, Some(max)) => format!("from {min} to {max}"),
        _ => "that is finite".to_owned(),
    }
}
