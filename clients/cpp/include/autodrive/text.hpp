/// \file
/// Text formats of the devkit protocol: numbers, base64, and base64 of gzip. Independent of the locale.
#pragma once

#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "autodrive/config.hpp"

/// Text formats of the devkit protocol.
namespace autodrive::text {

/// Numbers separated by blanks or line ends; "inf" and "nan" in any case. Throws `std::invalid_argument` for other
/// text.
inline std::vector<double> numbers(std::string_view text) {
    std::vector<double> found;
    const char* at = text.data();
    const char* const end = at + text.size();
    const auto is_separator = [](char c) { return c == ' ' || c == '\n' || c == '\t' || c == '\r'; };
    while (true) {
        while (at != end && is_separator(*at)) ++at;
        if (at == end) return found;
        double value = 0.0;
        const auto [next, error] = std::from_chars(at, end, value);
        if (error != std::errc{} || (next != end && !is_separator(*next))) {
            const char* word_end = at;
            while (word_end != end && word_end != at + 40 && !is_separator(*word_end)) ++word_end;
            throw std::invalid_argument("'" + std::string(at, word_end) + "' is not a number");
        }
        found.push_back(value);
        at = next;
    }
}

/// A number with six decimals. Throws `std::invalid_argument` if it is not finite.
inline std::string fixed(double value) {
    std::array<char, 400> text{};  // the largest double has 309 digits before the point
    if (!std::isfinite(value)) throw std::invalid_argument("a command must be a finite number");
    const auto [end, error] = std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::fixed, 6);
    static_cast<void>(error);  // it fits
    return {text.data(), end};
}

/// Decodes base64. Throws `std::invalid_argument` if the text is malformed.
inline std::vector<std::uint8_t> base64(std::string_view text) {
    static constexpr auto values = [] {
        std::array<std::uint8_t, 256> table{};
        for (auto& value : table) value = 0xff;
        constexpr std::string_view letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        for (std::size_t i = 0; i < letters.size(); ++i)
            table[static_cast<unsigned char>(letters[i])] = static_cast<std::uint8_t>(i);
        return table;
    }();
    const auto value = [&](std::size_t at) -> std::uint32_t { return values[static_cast<unsigned char>(text[at])]; };
    while (!text.empty() && text.back() == '=') text.remove_suffix(1);
    const std::size_t whole = text.size() / 4, rest = text.size() % 4;
    std::vector<std::uint8_t> bytes(whole * 3 + (rest ? rest - 1 : 0));
    std::uint8_t* to = bytes.data();
    std::uint32_t invalid = rest == 1 ? 0x80 : 0;  // bit 7 is set by characters that are not base64
    for (std::size_t at = 0; at < whole * 4; at += 4) {
        const std::uint32_t a = value(at), b = value(at + 1), c = value(at + 2), d = value(at + 3);
        invalid |= a | b | c | d;
        *to++ = static_cast<std::uint8_t>(a << 2 | b >> 4);
        *to++ = static_cast<std::uint8_t>(b << 4 | c >> 2);
        *to++ = static_cast<std::uint8_t>(c << 6 | d);
    }
    if (rest > 1) {
        const std::uint32_t a = value(whole * 4), b = value(whole * 4 + 1), c = rest == 3 ? value(whole * 4 + 2) : 0;
        invalid |= a | b | c;
        *to++ = static_cast<std::uint8_t>(a << 2 | b >> 4);
        if (rest == 3) *to++ = static_cast<std::uint8_t>(b << 4 | c >> 2);
    }
    if (invalid & 0x80) throw std::invalid_argument("invalid base64");
    return bytes;
}

/// Decompresses gzip (RFC 1952; one member without optional fields except a name, as written by Python and .NET).
/// Throws `std::invalid_argument` if the data is damaged or larger than 16 MB.
std::string gunzip(const std::vector<std::uint8_t>& data);

/// Values of a LIDAR: plain text, or base64 of gzip of text (since 2025).
inline std::vector<double> scan(std::string_view text) {
    return text.substr(0, 3) == "H4s" ? numbers(gunzip(base64(text))) : numbers(text);
}

}  // namespace autodrive::text

#ifndef AUTODRIVE_COMPILED
#include "autodrive/impl/text.ipp"
#endif
