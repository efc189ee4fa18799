#pragma once

#include <cstring>
#include <stdexcept>
#include <string>
#include <vector>

#include "autodrive/messages.hpp"

namespace autodrive::detail {

/// Converts MessagePack to JSON. The reader of nlohmann::json copies binary data byte by byte, ten times slower.
class Unpacker {
public:
    Unpacker(const std::uint8_t* at, std::size_t size) : at_(at), end_(at + size) {}

    Json value(int depth = 0) {
        if (depth > 100) throw std::runtime_error("MessagePack data is nested too deeply");
        const std::uint8_t code = *take(1);
        if (code < 0x80) return code;
        if (code < 0x90) return map(code & 0x0f, depth);
        if (code < 0xa0) return array(code & 0x0f, depth);
        if (code < 0xc0) return text(code & 0x1f);
        if (code >= 0xe0) return static_cast<std::int8_t>(code);
        switch (code) {
            case 0xc0: return nullptr;
            case 0xc2: return false;
            case 0xc3: return true;
            case 0xc4: return binary(number<std::uint8_t>());
            case 0xc5: return binary(number<std::uint16_t>());
            case 0xc6: return binary(number<std::uint32_t>());
            case 0xc7: return extension(number<std::uint8_t>());
            case 0xc8: return extension(number<std::uint16_t>());
            case 0xc9: return extension(number<std::uint32_t>());
            case 0xca: return number<float>();
            case 0xcb: return number<double>();
            case 0xcc: return number<std::uint8_t>();
            case 0xcd: return number<std::uint16_t>();
            case 0xce: return number<std::uint32_t>();
            case 0xcf: return number<std::uint64_t>();
            case 0xd0: return number<std::int8_t>();
            case 0xd1: return number<std::int16_t>();
            case 0xd2: return number<std::int32_t>();
            case 0xd3: return number<std::int64_t>();
            case 0xd4: case 0xd5: case 0xd6: case 0xd7: case 0xd8: return extension(std::size_t{1} << (code - 0xd4));
            case 0xd9: return text(number<std::uint8_t>());
            case 0xda: return text(number<std::uint16_t>());
            case 0xdb: return text(number<std::uint32_t>());
            case 0xdc: return array(number<std::uint16_t>(), depth);
            case 0xdd: return array(number<std::uint32_t>(), depth);
            case 0xde: return map(number<std::uint16_t>(), depth);
            case 0xdf: return map(number<std::uint32_t>(), depth);
            default: throw std::runtime_error("unknown MessagePack code " + std::to_string(code));
        }
    }

private:
    const std::uint8_t* take(std::size_t size) {
        if (size > static_cast<std::size_t>(end_ - at_)) throw std::runtime_error("MessagePack data is incomplete");
        at_ += size;
        return at_ - size;
    }

    /// Reads a big-endian number.
    template <typename Number>
    Number number() {
        const std::uint8_t* from = take(sizeof(Number));
        std::uint64_t bits = 0;
        for (std::size_t i = 0; i < sizeof(Number); ++i) bits = bits << 8 | from[i];
        Number value;
        if constexpr (sizeof(Number) == 8) {
            std::memcpy(&value, &bits, 8);
        } else if constexpr (std::is_same_v<Number, float>) {
            const auto narrow = static_cast<std::uint32_t>(bits);
            std::memcpy(&value, &narrow, 4);
        } else {
            value = static_cast<Number>(bits);
        }
        return value;
    }

    std::string text(std::size_t size) {
        const std::uint8_t* from = take(size);
        return {from, from + size};
    }

    std::vector<std::uint8_t> bytes(std::size_t size) {
        const std::uint8_t* from = take(size);
        return {from, from + size};
    }

    Json binary(std::size_t size) { return Json::binary(bytes(size)); }

    Json extension(std::size_t size) {
        const std::uint8_t type = *take(1);
        return Json::binary(bytes(size), type);
    }

    Json array(std::size_t size, int depth) {
        Json::array_t all;
        while (size--) all.push_back(value(depth + 1));
        return all;
    }

    Json map(std::size_t size, int depth) {
        Json::object_t all;
        while (size--) {
            Json key = value(depth + 1);
            all[key.get_ref<const std::string&>()] = value(depth + 1);
        }
        return all;
    }

    const std::uint8_t* at_;
    const std::uint8_t* const end_;
};

}  // namespace autodrive::detail
