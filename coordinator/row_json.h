// Messages as they lie in the database's rows: protobuf's JSON, field names as in proto/. Protobuf's own conversion looks up the types
// of a message anew each time; a page of a thousand jobs would wait for it.
#pragma once

#include <google/protobuf/message.h>

#include <string>

namespace woodcock::coordinator {

/// The text that protobuf makes, but for the order of fields and white space. Throws std::runtime_error where the message has no such form.
std::string to_row_json(const google::protobuf::Message& message);

/// Reads what either makes. Unknown fields are left out. Throws std::runtime_error with the text where it is malformed.
void from_row_json(const std::string& text, google::protobuf::Message& message);

}  // namespace woodcock::coordinator
