// The sky, for the cameras of the simulator and for the page. CLOUDS: there is `cloud_noise(vec2)`, whose two values are
// spread evenly from 0 to 1: of heaps, and of streaks.
// STARS: the zenith is dark. DAWN: `dawn` is not 0. QUICK: both layers of clouds have one pattern.
// sun_place: towards the sun or moon that is seen, drift of the clouds; dawn: glow below the sun, share of clouds
#ifdef STARS
vec3 star_light(vec3 d) {
    vec2 at = d.xy * (45.0 / (1.0 + d.z)), cell = floor(at);
    uvec2 h = uvec2(ivec2(cell) + 4096) * uvec2(0x9e3779b9u, 0x85ebca6bu);
    uint x = h.x ^ h.y;
    x ^= x >> 15u; x *= 0x2c1b3c6du; x ^= x >> 12u; x *= 0x297a2d39u; x ^= x >> 15u;
    vec3 r = vec3(float(x & 1023u), float((x >> 10u) & 1023u), float((x >> 20u) & 1023u)) / 1023.0;
    vec2 off = at - cell - 0.15 - 0.7 * r.xy, wide = max(fwidth(at), 0.03);
    vec2 near = clamp(1.2 - abs(off) / wide, 0.0, 1.0);
    vec2 share = min(0.06 / wide, 1.0);  // of a wide pixel
    float bright = r.z * r.z * r.z * share.x * share.y;
    return mix(vec3(1.0, 0.85, 0.7), vec3(0.75, 0.85, 1.0), r.x) * (0.5 * bright * near.x * near.y * smoothstep(0.0, 0.25, d.z));
}
#endif

// What is too small for a coarse image: stars, and the sun or the moon. `clear`: as in `wide_light`.
vec3 small_light(vec3 d, float clear) {
    vec3 seen = sun_color.rgb * (12.0 * clear * clear * smoothstep(0.99988, 0.99994, dot(d, sun_place.xyz)));
#ifdef STARS
    seen += star_light(d) * (clear * clamp(1.0 - 8.0 * zenith.g, 0.0, 1.0) * (1.0 - dawn.w));
#endif
    return seen;
}

// The rest, and the share of the stars that clouds let pass.
vec4 wide_light(vec3 d) {
    float up = clamp(d.z, 0.0, 1.0), c = dot(d, sun_place.xyz);
    vec3 seen = mix(horizon.rgb, zenith.rgb, sqrt(up)) * 0.31831;
    vec3 warm = vec3(0.0);
#ifdef DAWN
    float level = dot(d.xy, sun_place.xy) * inversesqrt(dot(d.xy, d.xy) * dot(sun_place.xy, sun_place.xy) + 1e-9);
    float towards = 0.5 + 0.5 * level, glow = exp(-6.5 * up);
    seen += dawn.rgb * (glow * (0.12 + 0.88 * towards * towards * towards * towards));
    warm = 0.5 * dawn.rgb * glow * towards;
#endif
    float off = 1.0 - c, clear = 1.0;
    vec3 bright = sun_color.rgb * (0.0025 / (0.002 + off));
#ifdef CLOUDS
    vec2 at = d.xy / (up + 0.14);
    float cover = dawn.w, shape = smoothstep(0.0, 0.16, up);
    vec2 low = cloud_noise(0.11 * at + sun_place.w), high = low;
#ifndef QUICK
    high = cloud_noise(0.06 * at.yx + 0.7 * sun_place.w);
#endif
    vec3 lit = 0.31831 * (0.5 * sun_color.rgb + 0.5 * (zenith.rgb + horizon.rgb)) + warm;
    float thin = shape * 0.55 * smoothstep(0.62 - 0.4 * cover, 1.1, high.g);
    float heap = shape * smoothstep(1.0 - 1.25 * cover, 1.12 - 1.0 * cover, low.r);
    seen = mix(seen, lit, thin);
    vec3 body = lit * (1.0 - 0.3 * heap * clamp(1.6 * low.r - 0.9 + cover, 0.0, 1.0)) * (0.82 + 0.36 * high.r);
    seen = mix(seen, body, heap);
    clear = (1.0 - thin) * (1.0 - heap);
#endif
    return vec4(seen + bright * clear * clear, clear);
}

vec3 sky_light(vec3 d) {
    vec4 seen = wide_light(d);
    return seen.rgb + small_light(d, seen.a);
}
