// Programs of the tests, in one file so that the headers are compiled once. Usage: tests
// text|messages|telemetry|events PORT
#include <autodrive/client.hpp>
#include <autodrive/impl/messages.ipp>
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

std::string wrong_field(const autodrive::Json& event) {
    try {
        autodrive::wire::read<autodrive::Frame>({{"time", 0.0}, {"tick", 1}, {"vehicles", autodrive::Json::object()},
                                                 {"objects", autodrive::Json::object()}, {"events", {event}},
                                                 {"scene_light", true}});
    } catch (const std::runtime_error& error) {
        return error.what();
    }
    return "";
}

// Values of a wrong type are refused by the name of their field; what a newer simulator adds is ignored.
void test_messages() {
    using autodrive::Json;
    const std::vector<std::uint8_t> zeros(24, 0);
    const Json position = Json::binary(zeros, 1);
    const Json lap = {{"type", "LapCompleted"}, {"time", 1.5}, {"vehicle", "V1"}, {"lap", 2}, {"lap_time", 1},
                      {"is_counted", true}, {"position", position}, {"a new field", {1, 2}}};
    const auto event = autodrive::wire::read<autodrive::Event>(lap);
    expect(event.type == "LapCompleted" && event.time == 1.5 && event.vehicle == "V1", "common fields");
    expect(event.as<autodrive::LapCompleted>()->lap == 2 && event.as<autodrive::LapCompleted>()->lap_time == 1.0, "fields");
    expect(event.as<autodrive::Collision>() == nullptr, "another event");
    const auto later = autodrive::wire::read<autodrive::Event>({{"type", "Later"}, {"time", 2.0}, {"position", "far"}});
    expect(later.type == "Later" && later.time == 2.0 && std::holds_alternative<std::monostate>(later.value), "new event");

    const auto expect_wrong = [&lap](const char* name, const Json& value, const std::string& reason) {
        Json changed = lap;
        changed[name] = value;
        if (value.is_discarded()) changed.erase(name);
        const std::string error = wrong_field(changed);
        expect(error == "a message of the simulator is wrong: field 'events.0." + std::string(name) + "' " + reason,
               error.c_str());
    };
    expect(wrong_field(lap).empty(), "a right event");
    expect_wrong("lap", "two", "must be an integer of 64 bits, not string");
    expect_wrong("lap", 1.5, "must be an integer of 64 bits, not number");
    expect_wrong("lap", std::uint64_t{1} << 63, "must be an integer of 64 bits, not number");
    expect_wrong("lap_time", nullptr, "must be a number, not null");
    expect_wrong("is_counted", 1, "must be a boolean, not number");
    expect_wrong("vehicle", Json::array(), "must be a text, not array");
    expect_wrong("position", {0.0, 0.0, 0.0}, "must be an array of type 1, not array");
    expect_wrong("position", Json::binary(zeros, 2), "must be an array of type 1");
    expect_wrong("position", Json::binary({1, 2, 3}, 1), "must be an array of type 1");
    expect_wrong("position", Json::binary({1, 2, 3, 4, 5, 6, 7, 8}, 1), "must have 3 values, not 1");
    expect_wrong("type", 3, "must be a text, not number");
    expect_wrong("lap", Json(Json::value_t::discarded), "is missing");
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

// Prints the vehicles of the events of a reset and of the next Frame.
void print_events(const char* port) {
    autodrive::Client simulator("127.0.0.1", static_cast<unsigned short>(std::atoi(port)));
    for (const autodrive::Frame& frame : {simulator.reset(), simulator.next()}) {
        for (const autodrive::Event& event : frame.events) std::cout << event.vehicle << ' ';
        std::cout << frame.tick << std::endl;
    }
}

}  // namespace

int main(int argc, char** argv) {
    const std::string command = argc > 1 ? argv[1] : "";
    if (command == "text") {
        test_text();
    } else if (command == "messages") {
        test_messages();
    } else if (command == "events" && argc > 2) {
        print_events(argv[2]);
    } else if (command == "telemetry") {
        print_telemetry();
    } else {
        std::cerr << "usage: tests text|messages|telemetry|events PORT" << std::endl;
        return 2;
    }
}
