// Physically based shading: sun with shadow, sky, headlights with shadows, small lamps. Formulas: glTF 2.0, appendix B.
// OUTLINED: vehicles have outlines. FLAT: its normal points up, GROUND: also at z = 0. FLAT and MATT have no gloss.
// QUICK: lamps cause no gloss. WINDOWS: some windows of facades are lit; no other still surface with a texture emits light.
// STILL: shadows of static meshes reach this draw call. CASTERS, BEAMS, LAMPS: number of vehicle shadows (of the ground:
// see ground_shade.frag), headlights and other lamps that reach it.
layout(std140) uniform Frame { FRAME_FIELDS };
layout(std140) uniform Camera { mat4 clip_from_map; vec4 eye; };

uniform sampler2DArray textures;
#ifdef GROUND
uniform sampler2D behind;  // for each pixel of it: paint, shade, shadow of vehicles, sky that they hide
#endif
uniform sampler2DShadow still_map, beam_map;
#if CASTERS > 0
uniform int casters[CASTERS];
#else
const int casters[1] = int[1](0);
#endif
#if BEAMS > 0
uniform int beams[BEAMS];
#else
const int beams[1] = int[1](0);
#endif
#if LAMPS > 0
uniform int lamp_numbers[LAMPS];
#else
const int lamp_numbers[1] = int[1](0);
#endif

in vec3 place, facing, in_sun;
flat in vec3 own_color, own_emission;
flat in vec4 own_finish;
in vec3 own_uv;
#ifdef FLAT
flat in vec3 from_sky, from_sun;
#elif defined(MATT)
in vec3 from_sky, from_sun;
#endif
out vec4 pixel;

TONE
LIGHT_FORMULAS

SHADOW_FORMULAS
float sunlit() {
    float lit = 1.0;
#ifdef STILL
    lit = unshaded(still_map, in_sun * still_scale.xyz + still_offset.xyz);
#endif
    for (int i = 0; i < CASTERS; i++) lit = min(lit, beside(casters[i], in_sun));
    return lit;
}

float openness() {
    float open = 1.0;
    for (int i = 0; i < CASTERS; i++) {
        vec4 other = caster_place[casters[i]], tile = caster_tile[casters[i]];
        open *= tile.w > 0.0 ? open_beside(other, tile.zw, place.xy - other.xy) : 1.0;
    }
    return open;
}

vec3 lamp_reflected(Finish f, vec3 n, vec3 v, vec3 l) {
#if defined(FLAT) || defined(MATT) || defined(QUICK)
    return matt(f, n, l);
#else
    return glossy(f, n, v, l);
#endif
}

void main() {
    vec3 v = normalize(eye.xyz - place);
#ifdef FLAT
    vec3 n = vec3(0.0, 0.0, 1.0);
#else
    vec3 n = normalize(facing);
#endif
    vec3 color = own_color;
#ifdef GROUND
    vec4 own = texelFetch(behind, ivec2(gl_FragCoord.xy), 0);
#endif
#ifdef TEXTURED
    vec3 texel = texture(textures, vec3(own_uv.xy, own_finish.z)).rgb;
#ifdef FINE  // a second, finer scale near the camera
    float near = clamp(1.5 - 1.5 * distance(eye.xyz, place), 0.0, 1.0);
    vec3 fine = texture(textures, vec3(3.1 * own_uv.xy, own_finish.z)).rgb;
    color *= texel * mix(texel, fine, near);
#else
    texel *= texel;  // textures are stored as square roots of linear values
    color *= texel;
#endif
#endif
#ifdef GROUND
    color = mix(color, PAINT, own.r);
#endif
#ifdef JOINTED
    bool is_still = own_finish.w != float(VEHICLE);  // vehicles are dry, and no snow lies on them
#else
    const bool is_still = true;
#endif
#if defined(WET) || defined(SNOW)
    if (is_still) color = weathered(color, n);
#endif
    float roughness = own_finish.x, metallic = own_finish.y;
    Finish f;
    f.alpha = roughness * roughness;
    f.roughness = roughness;
    f.diffuse = color * (1.0 - metallic);
    f.specular = mix(vec3(0.04), color, metallic);

    float open = openness() * own_uv.z;
#ifdef GROUND
    open *= (1.0 - min(own.g, 0.8)) * (1.0 - own.a);
#endif
#ifdef SUNLIT
    float lit = sunlit();
#ifdef GROUND
    lit = min(lit, 1.0 - own.b);
#endif
#else
    float lit = 1.0;
#endif
#if defined(FINE) && defined(SUNLIT)
    lit *= clamp(dot(uneven(fine.g, near), sun_direction.xyz) / sun_direction.z, 0.4, 1.6);
#endif
#if defined(FLAT) || defined(MATT)
    vec3 light = f.diffuse * (open * from_sky + lit * from_sun);
#else
    vec3 light = f.diffuse * 0.31831 * open * around(n);
    light += mirrored(f, n, v, open);
    light += glossy(f, n, v, sun_direction.xyz) * sun_color.rgb * lit;
#endif
    vec3 l;
    for (int i = 0; i < BEAMS; i++) {
        int b = beams[i];
        vec3 arriving = lamp_light(b, l);
        vec4 at = beam_from_map[b] * vec4(place + 0.004 * n, 1.0);
        at.xyz /= max(at.w, 1e-4);  // behind the lamp there is no light
        float above_axis = dot(-l, beam_up[b].xyz);
        arriving *= clamp(0.5 - above_axis * beam_up[b].w, 0.0, 1.0);
        arriving *= shadow(beam_map, at.xyz, vec2(BEAM_TEXEL));
#ifdef FLAT
        light += rough(f, arriving, v, l);
#else
        light += lamp_reflected(f, n, v, l) * arriving;
#endif
    }
    for (int i = 0; i < LAMPS; i++) {
        vec3 arriving = lamp_light(lamp_numbers[i], l);
        light += lamp_reflected(f, n, v, l) * arriving;
    }
#ifdef OUTLINED
    if (!is_still) light += outlined(own_color, n, v);
#endif
#if defined(JOINTED) || !defined(TEXTURED)
    vec3 emission = own_emission;
#elif defined(WINDOWS) && !defined(FLAT)
    vec3 emission = window_light(own_emission, texel, horizon.w, floor(own_uv.x), own_color + n);
#else
    const vec3 emission = vec3(0.0);
#endif
#ifdef WET
    if (is_still) light += glint(n, v) * open;
#endif
#ifdef GROUND
    light = hazy(light, v);
#endif
#ifdef AIR
    float share = exp(-exposure.z * distance(eye.xyz, place));  // the rest is light of the horizon
    light = mix(horizon.rgb * 0.31831, light, share);
#else
    const float share = 1.0;
#endif
    pixel = vec4(shown(light * exposure.x + emission * (share * exposure.y)), 1.0);
}
