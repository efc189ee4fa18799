// Formulas of light in fragment shaders, for the cameras of the simulator and for the page: glTF 2.0, appendix B.
const vec3 PAINT = vec3(0.82, 0.82, 0.79);  // of roads, as `WHITE` in meshes/map.py
struct Finish { vec3 diffuse, specular; float alpha, roughness; };

// Light from sky and floor on a surface with the normal n.
vec3 around(vec3 n) {
    return mix(floor_glow.rgb, 0.5 * (zenith.rgb + horizon.rgb), n.z * 0.5 + 0.5);
}

// Light of level ground, which fades into the horizon beyond what was placed: into its colour, and for a view along the
// ground also into the glow below a low sun. v: direction to the camera.
vec3 hazy(vec3 light, vec3 v) {
    vec2 beyond = max(max(extent.xy - place.xy, place.xy - extent.zw), 0.0);
    float far = dot(beyond, beyond);
    if (far > 0.0) {
        vec2 ahead = -v.xy * inversesqrt(dot(v.xy, v.xy) + 1e-9);
        float across = dot(ahead, sun_place.xy), along = 1.0 / (1.0 + 60.0 * v.z * v.z);
        float towards = 0.5 + 0.5 * across * inversesqrt(dot(sun_place.xy, sun_place.xy) + 1e-9);
        vec3 glow = dawn.rgb * (0.12 + 0.88 * towards * towards * towards * towards);
        glow += sun_color.rgb * (0.0025 / (1.002 - across));
#ifdef AIR
        glow *= exp(-150.0 * exposure.z);  // as in sky.frag at the horizon
#endif
        light = mix(light, horizon.rgb * 0.31831 + along * along * glow, far / (far + 36.0));
    }
    return light;
}

// What a surface mirrors of sky and floor.
vec3 mirrored(Finish f, vec3 n, vec3 v, float open) {
    vec3 r = reflect(-v, n);
    float x = 1.0 - clamp(dot(n, v), 0.0, 1.0), x2 = x * x;
    vec3 seen = mix(floor_glow.rgb, mix(horizon.rgb, zenith.rgb, clamp(r.z, 0.0, 1.0)), smoothstep(-0.15, 0.15, r.z));
    vec3 mirror = f.specular + (max(vec3(1.0 - f.roughness), f.specular) - f.specular) * (x2 * x2 * x);
    return seen * 0.31831 * open * mirror * (1.0 - 0.5 * f.roughness);
}

// Share of the sky that is visible at a point beside or below a vehicle: its place as in `caster_place`, its half size.
float open_beside(vec4 other, vec2 size, vec2 d) {
    vec2 outside = max(abs(vec2(dot(d, other.zw), dot(d, vec2(-other.w, other.z)))) - size, 0.0);
    float far = dot(outside, outside);
    far += clamp((far - 2e-4) * 5e3, 0.0, 1.0) * place.z * place.z;  // not on the vehicle itself
    return 1.0 - 0.75 * exp(-far * 700.0);
}

// Light of a vehicle at night, most at its outlines, by which people find it: no sensor sees it.
vec3 outlined(vec3 color, vec3 n, vec3 v) {
    float x = 1.0 - abs(dot(n, v));
    return zenith.rgb * (0.8 * sqrt(color) + 0.5 * x * x);
}

// Light from the direction l that goes to v: a matt surface, and one with gloss.
vec3 matt(Finish f, vec3 n, vec3 l) {
    return f.diffuse * (clamp(dot(n, l), 0.0, 1.0) * 0.31831);
}

vec3 glossy(Finish f, vec3 n, vec3 v, vec3 l) {
    float nl = clamp(dot(n, l), 0.0, 1.0);
    vec3 h = normalize(v + l);
    float nh = clamp(dot(n, h), 0.0, 1.0), vh = clamp(dot(v, h), 0.0, 1.0), nv = abs(dot(n, v)) + 1e-4;
    float a2 = f.alpha * f.alpha, d = nh * nh * (a2 - 1.0) + 1.0, k = 0.5 * f.alpha;
    float lobe = a2 / (3.14159 * d * d) * 0.25 / ((nl * (1.0 - k) + k) * (nv * (1.0 - k) + k));
    float x = 1.0 - vh, x2 = x * x;
    vec3 fresnel = f.specular + (1.0 - f.specular) * (x2 * x2 * x);
    return ((1.0 - fresnel) * f.diffuse * 0.31831 + fresnel * min(lobe, 40.0)) * nl;
}

// Asphalt and grass reflect light back to its source: law of Lommel and Seeliger for rough ground.
vec3 rough(Finish f, vec3 arriving, vec3 v, vec3 l) {
    return f.diffuse * 0.31831 * arriving * l.z / (l.z + v.z + 0.02);
}

// Irradiance [cd/m^2] of a surface that faces lamp i; l: direction to the lamp (KHR_lights_punctual).
vec3 lamp_light(int i, out vec3 l) {
    vec3 to = lamp_place[i].xyz - place;
    float d2 = max(dot(to, to), 1e-4), range = lamp_place[i].w, r2 = d2 / (range * range);
    l = to * inversesqrt(d2);
    float cone = clamp((dot(-l, lamp_aim[i].xyz) - lamp_aim[i].w) * lamp_color[i].w, 0.0, 1.0);
    float window = clamp(1.0 - r2 * r2, 0.0, 1.0);
    return lamp_color[i].rgb * (cone * cone * window * window / (d2 + 1e-3));
}

#ifdef WINDOWS
// Light of the lit windows of a facade, whose `texel` is linear. Glass is the only bluish part of it, and its green is
// the number of the window, 0 to 2. More windows are lit the darker it is, others on each wall. `light`: that of a window.
const float WINDOWS_LIT = 0.45;
vec3 window_light(vec3 light, vec3 texel, float dusk, float column, vec3 wall) {
    float blue = texel.b - texel.r, glass = smoothstep(0.005, 0.019, blue);
    float frame = 0.22 * max(texel.r - 0.5 * texel.b, 0.0);  // blue that a share of the window's frame takes away
    float number = floor(clamp(3.0 * (texel.g - texel.r + 0.3 * frame) / max(blue + frame, 1e-4), 0.0, 2.9));
    float own = fract(0.333 * number + 0.618 * column + dot(wall, vec3(7.1, 3.3, 5.7)));
    float lit = smoothstep(0.0, 0.05, dusk - WINDOWS_LIT - 0.8 * own);
    return light * (glass * lit) * mix(vec3(1.0), vec3(1.0, 1.25, 1.7), own);
}
#endif

#ifdef FINE
// Normal of level ground that is as uneven as the brightness of its texture, near the camera (Mikkelsen 2010).
vec3 uneven(float bright, float near) {
    vec2 x = dFdx(place.xy), y = dFdy(place.xy);
    vec2 slope = dFdx(bright) * vec2(y.y, -y.x) + dFdy(bright) * vec2(-x.y, x.x);
    float area = x.x * y.y - x.y * y.x;
    return vec3(clamp(slope * (-0.0006 * near / (abs(area) > 1e-12 ? area : 1e-12)), -0.4, 0.4), 1.0);
}
#endif

// Weather: exposure.z is the extinction of the air [1/m], exposure.w the wetness of the ground, floor_glow.w its snow cover.
// AIR, WET, SNOW: which of them are not 0.
#if defined(WET) || defined(SNOW)
// The colour of ground under water and snow: Lekner and Dorf 1988, as `weather.wet_reflectivity`; snow by the normal.
vec3 weathered(vec3 color, vec3 n) {
#ifdef WET
    color = mix(color, 0.5174 * color / (1.0 - 0.472 * color), exposure.w * smoothstep(0.3, 0.7, n.z));
#endif
#ifdef SNOW
    float uneven = 0.5 + 0.25 * (sin(place.x * 9.0 + 2.0 * sin(place.y * 7.0)) + sin(place.y * 13.0 + sin(place.x * 5.0)));
    float white = smoothstep(0.0, 0.3, 1.3 * floor_glow.w - uneven);
    vec2 wide = fwidth(place.xy);  // far away a pixel covers many patches and shows their mean
    white = mix(white, smoothstep(0.0, 1.0, floor_glow.w), clamp(4.0 * max(wide.x, wide.y) - 0.3, 0.0, 1.0));
    white *= smoothstep(0.35, 0.75, n.z);
    color = mix(color, vec3(0.82, 0.85, 0.9) * (0.93 + 0.07 * uneven), white);
#endif
    return color;
}
#endif
#ifdef WET
// What water on rough ground mirrors of the sky: 45 % of a smooth film (Fresnel's equations after Schlick, n = 1.33).
vec3 glint(vec3 n, vec3 v) {
    float x = 1.0 - clamp(dot(n, v), 0.0, 1.0), x2 = x * x;
    vec3 seen = mix(horizon.rgb, zenith.rgb, clamp(reflect(-v, n).z, 0.0, 1.0)) * 0.31831;
    return exposure.w * (1.0 - floor_glow.w) * smoothstep(0.3, 0.7, n.z) * 0.45 * (0.02 + 0.98 * x2 * x2 * x) * seen;
}
#endif
