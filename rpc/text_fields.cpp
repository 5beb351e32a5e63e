#include "rpc/text_fields.h"

#include <fmt/format.h>
#include <google/protobuf/descriptor.h>

#include <string>
#include <vector>

#include "rpc/error.h"
#include "rpc/printable.h"

namespace woodcock::rpc {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;

void check(const Message& message, const std::string& prefix) {
  const Reflection& reflection = *message.GetReflection();
  std::vector<const FieldDescriptor*> fields;
  reflection.ListFields(message, &fields);
  for (const FieldDescriptor* field : fields) {
    const bool is_message = field->cpp_type() == FieldDescriptor::CPPTYPE_MESSAGE;
    if (!is_message && field->type() != FieldDescriptor::TYPE_STRING) continue;
    const int count = field->is_repeated() ? reflection.FieldSize(message, field) : 1;
    for (int i = 0; i < count; ++i) {
      const auto name = [&] { return prefix + field->name() + (field->is_repeated() ? fmt::format("[{}]", i) : std::string()); };
      if (is_message) {
        check(field->is_repeated() ? reflection.GetRepeatedMessage(message, field, i) : reflection.GetMessage(message, field),
              name() + ".");
        continue;
      }
      std::string scratch;
      const std::string& text = field->is_repeated() ? reflection.GetRepeatedStringReference(message, field, i, &scratch)
                                                     : reflection.GetStringReference(message, field, &scratch);
      if (!is_utf8(text)) fail_invalid(name() + ": expected UTF-8, found \"" + printable(text.substr(0, 200)) + "\"");
    }
  }
}

}  // namespace

void check_text_fields(const Message& message) { check(message, ""); }

}  // namespace woodcock::rpc
