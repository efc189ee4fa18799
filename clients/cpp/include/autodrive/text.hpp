/// \file
/// The texts of the devkits' messages: numbers, base64, and base64 of gzip. The locale has no say in them.
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

/// The texts of the devkits' messages.
namespace autodrive::text {

/// Numbers that are separated by blanks or line ends; "inf" and "nan" in any case. What is no number is an error:
/// `std::invalid_argument`.
inline std::vector<double> numbers(std::string_view text) {
    std::vector<double> found;
    const char* at = text.data();
    const char* const end = at + text.size();
    const auto is_gap = [](char c) { return c == ' ' || c == '\n' || c == '\t' || c == '\r'; };
    while (true) {
        while (at != end && is_gap(*at)) ++at;
        if (at == end) return found;
        double value = 0.0;
        const auto [next, fault] = std::from_chars(at, end, value);
        if (fault != std::errc{} || (next != end && !is_gap(*next))) {
            const char* word_end = at;
            while (word_end != end && word_end != at + 40 && !is_gap(*word_end)) ++word_end;
            throw std::invalid_argument("'" + std::string(at, word_end) + "' is not a number");
        }
        found.push_back(value);
        at = next;
    }
}

/// A number with six decimals. What is not finite is an error: `std::invalid_argument`.
inline std::string fixed(double value) {
    std::array<char, 400> text{};  // the largest double has 309 digits before the point
    if (!std::isfinite(value)) throw std::invalid_argument("a command must be a finite number");
    const auto [end, fault] = std::to_chars(text.data(), text.data() + text.size(), value, std::chars_format::fixed, 6);
    static_cast<void>(fault);  // it fits
    return {text.data(), end};
}

/// The bytes that a base64 text stands for. A text that is none is an error: `std::invalid_argument`.
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
    std::uint32_t strange = rest == 1 ? 0x80 : 0;  // a letter that base64 has not sets a bit which none of its own has
    for (std::size_t at = 0; at < whole * 4; at += 4) {
        const std::uint32_t a = value(at), b = value(at + 1), c = value(at + 2), d = value(at + 3);
        strange |= a | b | c | d;
        *to++ = static_cast<std::uint8_t>(a << 2 | b >> 4);
        *to++ = static_cast<std::uint8_t>(b << 4 | c >> 2);
        *to++ = static_cast<std::uint8_t>(c << 6 | d);
    }
    if (rest > 1) {
        const std::uint32_t a = value(whole * 4), b = value(whole * 4 + 1), c = rest == 3 ? value(whole * 4 + 2) : 0;
        strange |= a | b | c;
        *to++ = static_cast<std::uint8_t>(a << 2 | b >> 4);
        if (rest == 3) *to++ = static_cast<std::uint8_t>(b << 4 | c >> 2);
    }
    if (strange & 0x80) throw std::invalid_argument("this is not base64");
    return bytes;
}

/// What was compressed with gzip (RFC 1952; one member without optional fields but a name, as Python and .NET write
/// it). Damaged or more than 16 MB is an error: `std::invalid_argument`.
std::string gunzip(const std::vector<std::uint8_t>& data);

/// A LIDAR's values: plain text, or base64 of gzip of text, as since 2025.
inline std::vector<double> scan(std::string_view text) {
    return text.substr(0, 3) == "H4s" ? numbers(gunzip(base64(text))) : numbers(text);
}

}  // namespace autodrive::text

#ifndef AUTODRIVE_COMPILED
#include "autodrive/impl/text.ipp"
#endif
