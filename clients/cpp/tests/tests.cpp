// Programs of the tests, in one file so that the headers are compiled once. Usage: tests text|telemetry
#include <autodrive/telemetry.hpp>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <iomanip>
#include <iostream>
#include <iterator>

using autodrive::devkit::State;
using autodrive::devkit::Telemetry;
namespace text = autodrive::text;

namespace {

void expect(bool condition, const char* what) {
    if (condition) return;
    std::cerr << "failed: " << what << std::endl;
    std::exit(1);
}

void expect_invalid(const std::function<void()>& call, const char* what) {
    try {
        call();
    } catch (const std::invalid_argument&) {
        return;
    }
    expect(false, what);
}

std::string decoded(const char* encoded) {
    const auto bytes = text::base64(encoded);
    return {bytes.begin(), bytes.end()};
}

// Compares the text functions with values from other sources (RFC 4648 section 10, Python's gzip).
void test_text() {
    expect(decoded("") == "" && decoded("Zg==") == "f" && decoded("Zm8=") == "fo" && decoded("Zm9v") == "foo" &&
               decoded("Zm9vYg==") == "foob" && decoded("Zm9vYmE=") == "fooba" && decoded("Zm9vYmFy") == "foobar",
           "base64 of RFC 4648");
    for (const char* malformed : {"Zm9v!", "!m9v", "Zm!=", "Z", "Zm9vZ", "Zm\xff\xff", "Zm=v"})
        expect_invalid([malformed] { text::base64(malformed); }, malformed);

    expect(text::numbers("") == std::vector<double>{}, "no numbers");
    expect(text::numbers(" 1 -0.25\n3e-2 ") == std::vector<double>{1.0, -0.25, 0.03}, "numbers");
    expect(std::isinf(text::numbers("inf")[0]), "inf");
    expect_invalid([] { text::numbers("1 two"); }, "a word");
    expect_invalid([] { text::numbers("1.5x"); }, "text after a number");

    // base64.b64encode(gzip.compress(b"inf\n1.5\n2.25", mtime=0))
    const auto scan = text::scan("H4sIAAAAAAACA8vMS+My1DPlMtIzMgUAboeLngwAAAA=");
    expect(scan.size() == 3 && std::isinf(scan[0]) && scan[1] == 1.5 && scan[2] == 2.25, "gzip");
    expect_invalid([] { text::gunzip({1, 2, 3}); }, "not gzip");
    expect_invalid([] { text::scan("H4sIAAAAAAAC/8vMS+Pyyyyyyyyyyyyyyyyyyyy="); }, "damaged gzip");
    expect(text::fixed(-0.25) == "-0.250000" && text::fixed(1e15) == "1000000000000000.000000", "fixed");
    expect_invalid([] { text::fixed(NAN); }, "not a number");
}

template <typename Values>
void print(const char* name, const Values& values) {
    std::cout << name;
    for (const auto value : values) std::cout << ' ' << +value;
    std::cout << '\n';
}

// Reads a telemetry message from standard input and prints the state of V1, one field a line, then the errors.
void print_telemetry() {
    const std::string message((std::istreambuf_iterator<char>(std::cin)), std::istreambuf_iterator<char>());
    const auto telemetry = Telemetry::parse(message);
    if (!telemetry) {
        std::cout << "no message" << std::endl;
        return;
    }
    State state;
    const auto errors = autodrive::devkit::read(*telemetry, "V1 ", state);
    std::cout << std::setprecision(17);
    print("throttle", std::vector{state.throttle});
    print("steering", std::vector{state.steering});
    print("speed", std::vector{state.speed});
    print("encoder_ticks", state.encoder_ticks);
    print("encoder_angles", state.encoder_angles);
    print("position", state.position);
    print("orientation", state.orientation.coeffs());
    print("euler_angles", state.euler_angles);
    print("angular_velocity", state.angular_velocity);
    print("linear_acceleration", state.linear_acceleration);
    print("lidar_scan_rate", std::vector{state.lidar_scan_rate});
    print("lidar_ranges", state.lidar_ranges);
    print("lidar_intensities", state.lidar_intensities);
    print("front_camera_jpeg", state.front_camera_jpeg);
    print("rear_camera_jpeg", state.rear_camera_jpeg);
    for (const std::string& error : errors) std::cout << "error " << error << '\n';
}

}  // namespace

int main(int argc, char** argv) {
    const std::string command = argc > 1 ? argv[1] : "";
    if (command == "text") {
        test_text();
    } else if (command == "telemetry") {
        print_telemetry();
    } else {
        std::cerr << "usage: tests text|telemetry" << std::endl;
        return 2;
    }
}
