// Khronos PBR Neutral tone mapping, then the sRGB transfer function (a fit by square roots, within 0.003).
vec3 shown(vec3 c) {
    float x = min(c.r, min(c.g, c.b));
    c -= x < 0.08 ? x - 6.25 * x * x : 0.04;
    float peak = max(c.r, max(c.g, c.b)), low = 0.8 - 0.04, d = 1.0 - low;
    float bright = 1.0 - d * d / (peak + d - low);
    float g = 1.0 - 1.0 / (0.15 * (peak - bright) + 1.0);
    vec3 pressed = mix(c * (bright / max(peak, 1e-4)), vec3(bright), g);
    c = clamp(peak < low ? c : pressed, 0.0, 1.0);
    vec3 s1 = sqrt(c), s2 = sqrt(s1), s3 = sqrt(s2);
    return clamp(0.662002687 * s1 + 0.684122060 * s2 - 0.323583601 * s3 - 0.0225411470 * c, 0.0, 1.0);
}
