// The light of a pixel as a colour: highlights as in Khronos PBR Neutral tone mapping, without its toe, which would make
// nights black; then the sRGB transfer function, by square roots (error below 0.01, in the mean 0.0001) unless EXACT.
vec3 shown(vec3 c) {
    float peak = max(c.r, max(c.g, c.b)), low = 0.76, d = 1.0 - low;
    float bright = 1.0 - d * d / (peak + d - low), excess = 0.15 * (peak - bright);
    vec3 pressed = (c + excess * peak) * (bright / (peak * (1.0 + excess)));
    c = clamp(peak < low ? c : pressed, 0.0, 1.0);
#ifdef EXACT
    return mix(1.055 * pow(c, vec3(1.0 / 2.4)) - 0.055, 12.92 * c, lessThanEqual(c, vec3(0.0031308)));
#else
    vec3 s1 = sqrt(c), s2 = sqrt(s1), s3 = sqrt(s2);
    return clamp(0.662002687 * s1 + 0.684122060 * s2 - 0.323583601 * s3 - 0.0225411470 * c, 0.0, 1.0);
#endif
}
