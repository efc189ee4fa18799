// The texts of the devkits' messages against values known from elsewhere (RFC 4648 section 10, Python's gzip).
#include <autodrive/text.hpp>
#include <cstdlib>
#include <functional>
#include <iostream>

namespace {

void expect(bool is_so, const char* what) {
    if (is_so) return;
    std::cerr << "not so: " << what << std::endl;
    std::exit(1);
}

void expect_refused(const std::function<void()>& deed, const char* what) {
    try {
        deed();
    } catch (const std::invalid_argument&) {
        return;
    }
    expect(false, what);
}

std::string decoded(const char* text) {
    const auto bytes = autodrive::text::base64(text);
    return {bytes.begin(), bytes.end()};
}

}  // namespace

int main() {
    using namespace autodrive;
    expect(decoded("") == "" && decoded("Zg==") == "f" && decoded("Zm8=") == "fo" && decoded("Zm9v") == "foo" &&
               decoded("Zm9vYg==") == "foob" && decoded("Zm9vYmE=") == "fooba" && decoded("Zm9vYmFy") == "foobar",
           "base64 of RFC 4648");
    for (const char* strange : {"Zm9v!", "!m9v", "Zm!=", "Z", "Zm9vZ", "Zm\xff\xff", "Zm=v"})
        expect_refused([strange] { text::base64(strange); }, strange);

    expect(text::numbers("") == std::vector<double>{}, "no numbers");
    expect(text::numbers(" 1 -0.25\n3e-2 ") == std::vector<double>{1.0, -0.25, 0.03}, "numbers");
    expect(std::isinf(text::numbers("inf")[0]), "inf");
    expect_refused([] { text::numbers("1 two"); }, "a word is refused");
    expect_refused([] { text::numbers("1.5x"); }, "what follows a number is refused");

    // base64.b64encode(gzip.compress(b"inf\n1.5\n2.25", mtime=0))
    const auto packed = text::scan("H4sIAAAAAAACA8vMS+My1DPlMtIzMgUAboeLngwAAAA=");
    expect(packed.size() == 3 && std::isinf(packed[0]) && packed[1] == 1.5 && packed[2] == 2.25, "gzip");
    expect_refused([] { text::gunzip({1, 2, 3}); }, "what is not gzip is refused");
    expect_refused([] { text::scan("H4sIAAAAAAAC/8vMS+Pyyyyyyyyyyyyyyyyyyyy="); }, "damaged gzip is refused");
    expect(text::fixed(-0.25) == "-0.250000" && text::fixed(1e15) == "1000000000000000.000000", "numbers are written");
    expect_refused([] { text::fixed(NAN); }, "what is no number is not written");
    std::cout << "all is so" << std::endl;
}
