//! The schema of a topic that pilots define.

use serde::{Deserialize, Serialize};
use serde_json::Value;

/// What the messages of a pilots' topic look like: JSON objects that follow a JSON schema.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TopicSchema {
    /// Name of the topic.
    pub topic: String,
    /// The JSON schema of its messages.
    pub schema: Value,
}
