#include "coordinator/row_json.h"

#include <google/protobuf/descriptor.h>
#include <google/protobuf/util/json_util.h>
#include <nlohmann/json.hpp>

#include <charconv>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace woodcock::coordinator {
namespace {

using google::protobuf::FieldDescriptor;
using google::protobuf::Message;
using google::protobuf::Reflection;
using Json = nlohmann::json;

/// What the fields of rows are made of. False, or nothing, for all else: that is protobuf's to convert.
bool put(const Message& message, Json& object);

/// A value of the field; of a list its element `i`.
std::optional<Json> value_of(const Message& message, const FieldDescriptor& field, int i) {
  const Reflection& reflection = *message.GetReflection();
  const bool list = field.is_repeated();
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_INT32:
      return list ? reflection.GetRepeatedInt32(message, &field, i) : reflection.GetInt32(message, &field);
    case FieldDescriptor::CPPTYPE_UINT32:
      return list ? reflection.GetRepeatedUInt32(message, &field, i) : reflection.GetUInt32(message, &field);
    case FieldDescriptor::CPPTYPE_INT64:  // 64 bits are texts: a number of JSON has 53
      return std::to_string(list ? reflection.GetRepeatedInt64(message, &field, i) : reflection.GetInt64(message, &field));
    case FieldDescriptor::CPPTYPE_UINT64:
      return std::to_string(list ? reflection.GetRepeatedUInt64(message, &field, i) : reflection.GetUInt64(message, &field));
    case FieldDescriptor::CPPTYPE_BOOL:
      return list ? reflection.GetRepeatedBool(message, &field, i) : reflection.GetBool(message, &field);
    case FieldDescriptor::CPPTYPE_DOUBLE: {
      const double value = list ? reflection.GetRepeatedDouble(message, &field, i) : reflection.GetDouble(message, &field);
      return std::isfinite(value) ? std::optional<Json>(value) : std::nullopt;
    }
    case FieldDescriptor::CPPTYPE_STRING:
      if (field.type() != FieldDescriptor::TYPE_STRING) return std::nullopt;
      return list ? reflection.GetRepeatedString(message, &field, i) : reflection.GetString(message, &field);
    case FieldDescriptor::CPPTYPE_MESSAGE: {
      Json object = Json::object();
      const Message& inner = list ? reflection.GetRepeatedMessage(message, &field, i) : reflection.GetMessage(message, &field);
      return put(inner, object) ? std::optional(std::move(object)) : std::nullopt;
    }
    default:
      return std::nullopt;
  }
}

bool put(const Message& message, Json& object) {
  std::vector<const FieldDescriptor*> fields;
  message.GetReflection()->ListFields(message, &fields);
  for (const FieldDescriptor* field : fields) {
    if (field->is_map()) return false;
    if (!field->is_repeated()) {
      std::optional<Json> value = value_of(message, *field, 0);
      if (!value) return false;
      object[field->name()] = std::move(*value);
      continue;
    }
    Json list = Json::array();
    for (int i = 0; i < message.GetReflection()->FieldSize(message, field); ++i) {
      std::optional<Json> value = value_of(message, *field, i);
      if (!value) return false;
      list.push_back(std::move(*value));
    }
    object[field->name()] = std::move(list);
  }
  return true;
}

/// An integer of the type, as a number or a text.
template <typename Integer>
std::optional<Integer> integer_of(const Json& value) {
  Integer number = 0;
  if (value.is_string()) {
    const std::string& text = value.get_ref<const std::string&>();
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
    return number;
  }
  if (value.is_number_unsigned()) {
    const auto given = value.get<uint64_t>();
    return std::in_range<Integer>(given) ? std::optional(static_cast<Integer>(given)) : std::nullopt;
  }
  if (value.is_number_integer()) {
    const auto given = value.get<int64_t>();
    return std::in_range<Integer>(given) ? std::optional(static_cast<Integer>(given)) : std::nullopt;
  }
  return std::nullopt;
}

bool take(const Json& object, Message& message);

/// Sets the field, or appends to the list that it is.
bool take_value(const Json& value, Message& message, const FieldDescriptor& field) {
  const Reflection& reflection = *message.GetReflection();
  const bool list = field.is_repeated();
  switch (field.cpp_type()) {
    case FieldDescriptor::CPPTYPE_INT32: {
      const auto number = integer_of<int32_t>(value);
      if (number) list ? reflection.AddInt32(&message, &field, *number) : reflection.SetInt32(&message, &field, *number);
      return number.has_value();
    }
    case FieldDescriptor::CPPTYPE_UINT32: {
      const auto number = integer_of<uint32_t>(value);
      if (number) list ? reflection.AddUInt32(&message, &field, *number) : reflection.SetUInt32(&message, &field, *number);
      return number.has_value();
    }
    case FieldDescriptor::CPPTYPE_INT64: {
      const auto number = integer_of<int64_t>(value);
      if (number) list ? reflection.AddInt64(&message, &field, *number) : reflection.SetInt64(&message, &field, *number);
      return number.has_value();
    }
    case FieldDescriptor::CPPTYPE_UINT64: {
      const auto number = integer_of<uint64_t>(value);
      if (number) list ? reflection.AddUInt64(&message, &field, *number) : reflection.SetUInt64(&message, &field, *number);
      return number.has_value();
    }
    case FieldDescriptor::CPPTYPE_BOOL:
      if (!value.is_boolean()) return false;
      list ? reflection.AddBool(&message, &field, value.get<bool>()) : reflection.SetBool(&message, &field, value.get<bool>());
      return true;
    case FieldDescriptor::CPPTYPE_DOUBLE:
      if (!value.is_number()) return false;
      list ? reflection.AddDouble(&message, &field, value.get<double>()) : reflection.SetDouble(&message, &field, value.get<double>());
      return true;
    case FieldDescriptor::CPPTYPE_STRING:
      if (field.type() != FieldDescriptor::TYPE_STRING || !value.is_string()) return false;
      list ? reflection.AddString(&message, &field, value.get<std::string>())
           : reflection.SetString(&message, &field, value.get<std::string>());
      return true;
    case FieldDescriptor::CPPTYPE_MESSAGE:
      return take(value, list ? *reflection.AddMessage(&message, &field) : *reflection.MutableMessage(&message, &field));
    default:
      return false;
  }
}

bool take(const Json& object, Message& message) {
  if (!object.is_object()) return false;
  for (const auto& [name, value] : object.items()) {
    const FieldDescriptor* field = message.GetDescriptor()->FindFieldByName(name);
    if (!field || field->is_map()) return false;
    if (!field->is_repeated()) {
      if (!take_value(value, message, *field)) return false;
      continue;
    }
    if (!value.is_array()) return false;
    for (const Json& element : value)
      if (!take_value(element, message, *field)) return false;
  }
  return true;
}

}  // namespace

std::string to_row_json(const Message& message) {
  Json object = Json::object();
  if (put(message, object)) return object.dump();
  std::string text;
  google::protobuf::util::JsonPrintOptions options;
  options.preserve_proto_field_names = true;
  if (!google::protobuf::util::MessageToJsonString(message, &text, options).ok()) throw std::runtime_error("a message has no JSON form");
  return text;
}

void from_row_json(const std::string& text, Message& message) {
  message.Clear();
  const Json object = Json::parse(text, nullptr, false);
  if (!object.is_discarded() && take(object, message)) return;
  message.Clear();
  google::protobuf::util::JsonParseOptions options;
  options.ignore_unknown_fields = true;
  if (!google::protobuf::util::JsonStringToMessage(text, &message, options).ok())
    throw std::runtime_error("malformed JSON in the database: " + text);
}

}  // namespace woodcock::coordinator
