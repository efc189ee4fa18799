#pragma once

#include <algorithm>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <type_traits>

#include "autodrive/messages.hpp"

namespace autodrive::wire {

/// A value of a message that is not of the type of its field. `what` names the field.
struct WrongValue : std::runtime_error {
    WrongValue(const std::string& path, const std::string& reason)
        : std::runtime_error("a message of the simulator is wrong: field '" + path + "' " + reason),
          path(path), reason(reason) {}
    std::string path, reason;
};

[[noreturn]] inline void refuse(const Json& json, const std::string& expected) {
    throw WrongValue("", "must be " + expected + ", not " + json.type_name());
}

/// Calls `read`, and puts the name in front of the path of an error.
template <typename Read>
void within(const std::string& name, Read read) {
    try {
        read();
    } catch (const WrongValue& error) {
        throw WrongValue(error.path.empty() ? name : name + "." + error.path, error.reason);
    }
}

/// Reads the value of a field from JSON. Fields that a message does not know are ignored.
struct Reader {
    static void read(const Json& json, bool& value) {
        if (!json.is_boolean()) refuse(json, "a boolean");
        value = json.get<bool>();
    }

    static void read(const Json& json, double& value) {
        if (!json.is_number()) refuse(json, "a number");
        value = json.get<double>();
    }

    static void read(const Json& json, std::int64_t& value) {
        const bool is_large = json.is_number_unsigned() &&
                              json.get<std::uint64_t>() > std::uint64_t{std::numeric_limits<std::int64_t>::max()};
        if (!json.is_number_integer() || is_large) refuse(json, "an integer of 64 bits");
        value = json.get<std::int64_t>();
    }

    static void read(const Json& json, int& value) {
        std::int64_t wide = 0;
        read(json, wide);
        value = static_cast<int>(wide);
        if (value != wide) refuse(json, "an integer of 32 bits");
    }

    static void read(const Json& json, std::string& value) {
        if (!json.is_string()) refuse(json, "a text");
        value = json.get_ref<const std::string&>();
    }

    template <typename Value>
    static void read(const Json& json, std::optional<Value>& value) {
        if (json.is_null())
            value.reset();
        else
            read(json, value.emplace());
    }

    template <typename Value>
    static void read(const Json& json, std::map<std::string, Value>& values) {
        if (!json.is_object()) refuse(json, "a map");
        for (const auto& [name, value] : json.items()) {
            const Json& source = value;
            within(name, [&, &key = name] { read(source, values[key]); });
        }
    }

    /// Reads an array: a MessagePack extension of little-endian values. Values of other types are a list.
    template <typename Value>
    static void read(const Json& json, std::vector<Value>& values) {
        if constexpr (array_code<Value> != 0) {
            values.resize(bytes<Value>(json).size() / sizeof(Value));
            if (!values.empty()) std::memcpy(values.data(), bytes<Value>(json).data(), values.size() * sizeof(Value));
        } else {
            if (!json.is_array()) refuse(json, "a list");
            values.resize(json.size());
            for (std::size_t i = 0; i < values.size(); ++i)
                within(std::to_string(i), [&] { read(json[i], values[i]); });
        }
    }

    template <typename Value, std::size_t size>
    static void read(const Json& json, std::array<Value, size>& values) {
        if (json.is_binary()) {
            copy(json, values.data(), size);
        } else {
            if (!json.is_array() || json.size() != size) refuse(json, std::to_string(size) + " values");
            for (std::size_t i = 0; i < size; ++i)
                within(std::to_string(i), [&] { read(json[i], values[i]); });
        }
    }

    template <int size>
    static void read(const Json& json, Eigen::Matrix<double, size, 1>& vector) {
        copy(json, vector.data(), size);
    }

    static void read(const Json& json, Eigen::Quaterniond& quaternion) {
        std::array<double, 4> wxyz{};
        copy(json, wxyz.data(), wxyz.size());
        quaternion = {wxyz[0], wxyz[1], wxyz[2], wxyz[3]};
    }

    static void read(const Json& json, Event& event) {
        if (!json.is_object()) refuse(json, "a map");
        within("type", [&] { read(json.value("type", Json()), event.type); });
        read_value(json, event.value);
        const bool is_known = !std::holds_alternative<std::monostate>(event.value);
        const auto read_common = [&](const char* name, auto& value) {
            try {
                if (const auto field = json.find(name); field != json.end()) read(*field, value);
            } catch (const WrongValue&) {  // an event of a newer simulator may have other types
                if (is_known) throw;
            }
        };
        read_common("time", event.time);
        read_common("vehicle", event.vehicle);
        read_common("position", event.position);
        for (const char* name : {"sign", "light", "other"}) read_common(name, event.other);
    }

    template <typename Message>
    static void read(const Json& json, Message& message) {
        if (!json.is_object()) refuse(json, "a map");
        visit_fields(message, [&json](const char* name, auto& value, bool is_required) {
            const auto field = json.find(name);
            if (field != json.end())
                within(name, [&] { read(*field, value); });
            else if (is_required)
                throw WrongValue(name, "is missing");
        });
        repeat(message);
    }

private:
    /// The bytes of an array of these values; those of a picture are without a type.
    template <typename Value>
    static const Json::binary_t& bytes(const Json& json) {
        static const std::string expected = "an array of type " + std::to_string(array_code<Value>);
        if (!json.is_binary()) refuse(json, expected);
        const auto& binary = json.get_binary();
        const bool is_expected = binary.has_subtype() ? binary.subtype() == array_code<Value> : sizeof(Value) == 1;
        if (!is_expected || binary.size() % sizeof(Value)) throw WrongValue("", "must be " + expected);
        return binary;
    }

    template <typename Value>
    static void copy(const Json& json, Value* values, std::size_t size) {
        const auto& binary = bytes<Value>(json);
        if (binary.size() != size * sizeof(Value))
            throw WrongValue("", "must have " + std::to_string(size) + " values, not " +
                                     std::to_string(binary.size() / sizeof(Value)));
        std::memcpy(values, binary.data(), binary.size());
    }

    /// Reads the alternative whose type is that of the event; none: the type is not known.
    template <typename... Kinds>
    static void read_value(const Json& json, std::variant<std::monostate, Kinds...>& value) {
        const std::string& type = json.at("type").get_ref<const std::string&>();
        value = std::monostate{};
        ((type == Kinds::type ? read(json, value.template emplace<Kinds>()) : void()), ...);
    }
};

/// A message or a part of one. Throws `WrongValue`.
template <typename Message>
Message read(const Json& json) {
    Message message;
    Reader::read(json, message);
    return message;
}

/// Writes values of fields as JSON.
struct Writer {
    template <typename Value>
    static Json written(const Value& value) {
        return value;
    }

    static Json written(const Eigen::Vector3d& vector) { return {vector.x(), vector.y(), vector.z()}; }

    template <typename Value>
    static Json written(const std::vector<Value>& values) {
        Json list = Json::array();
        for (const Value& value : values) list.push_back(written(value));
        return list;
    }

    template <typename Value>
    static Json written(const std::optional<Value>& value) {
        return value ? written(*value) : Json();
    }
};

/// A message as JSON.
template <typename Message>
Json write(Message message) {
    Json json;
    visit_fields(message, [&json](const char* name, const auto& value, bool) { json[name] = Writer::written(value); });
    return json;
}

}  // namespace autodrive::wire
