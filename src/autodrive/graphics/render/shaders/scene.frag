// Physically based shading: sun with shadow, sky, headlights with shadows, small lamps. Formulas: glTF 2.0, appendix B.
// FLAT: level ground. FLAT and MATT have no gloss. QUICK: lamps cause no gloss. STILL: shadows of static meshes reach this
// draw call. CASTERS, BEAMS, LAMPS: number of vehicle shadows, headlights and other lamps that reach it.
layout(std140) uniform Frame { FRAME_FIELDS };
layout(std140) uniform Camera { mat4 clip_from_map; vec4 eye; };

uniform sampler2DArray textures;
uniform sampler2DShadow still_map, caster_map, beam_map;
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
in vec2 own_uv;
#ifdef FLAT
flat in vec3 from_sky, from_sun;
#elif defined(MATT)
in vec3 from_sky, from_sun;
#endif
out vec4 pixel;

TONE

float shadow(sampler2DShadow map, vec3 at, vec2 texel) {
#if TAPS == 1
    return texture(map, at);
#else
    float sum = 0.0;
    for (int i = -1; i <= 1; i++)
        for (int j = -1; j <= 1; j++) sum += texture(map, at + vec3(vec2(i, j) * texel, 0.0));
    return sum / 9.0;
#endif
}

float sunlit() {
    float lit = 1.0;
    vec3 at, off;
#ifdef STILL
    at = in_sun * still_scale.xyz + still_offset.xyz;
    lit = shadow(still_map, at, vec2(still_scale.w));  // outside the map there is no shadow
#endif
    for (int i = 0; i < CASTERS; i++) {
        vec4 tile = caster_tile[casters[i]];
        at = in_sun * caster_half.zzw + caster_offset[casters[i]].xyz;
        off = abs(at - 0.5);
        bool inside = max(off.x, off.y) < 0.48 &&  // filtering at the border would read the next tile
                       at.z < 1.0 && tile.w > 0.0;
        float own = shadow(caster_map, vec3(tile.xy + at.xy * tile.z, at.z), vec2(tile.w));
        lit = min(lit, inside ? own : 1.0);
    }
    return lit;
}

// Share of the sky that is visible at a point: less below vehicles and near the ground beside them.
float openness() {
    float open = 1.0;
    for (int i = 0; i < CASTERS; i++) {
        vec4 other = caster_place[casters[i]];
        vec2 d = place.xy - other.xy;
        vec2 outside = max(abs(vec2(dot(d, other.zw), dot(d, vec2(-other.w, other.z)))) - caster_half.xy, 0.0);
        float far = dot(outside, outside);
        far += clamp((far - 2e-4) * 5e3, 0.0, 1.0) * place.z * place.z;  // not on the vehicle itself
        open *= caster_tile[casters[i]].w > 0.0 ? 1.0 - 0.75 * exp(-far * 700.0) : 1.0;
    }
    return open;
}

struct Finish { vec3 diffuse, specular; float alpha, roughness; };

vec3 reflected(Finish f, vec3 n, vec3 v, vec3 l) {
    float nl = clamp(dot(n, l), 0.0, 1.0);
#if defined(FLAT) || defined(MATT)
    return f.diffuse * (nl * 0.31831);
#else
    vec3 h = normalize(v + l);
    float nh = clamp(dot(n, h), 0.0, 1.0), vh = clamp(dot(v, h), 0.0, 1.0), nv = abs(dot(n, v)) + 1e-4;
    float a2 = f.alpha * f.alpha, d = nh * nh * (a2 - 1.0) + 1.0, k = 0.5 * f.alpha;
    float lobe = a2 / (3.14159 * d * d) * 0.25 / ((nl * (1.0 - k) + k) * (nv * (1.0 - k) + k));
    float x = 1.0 - vh, x2 = x * x;
    vec3 fresnel = f.specular + (1.0 - f.specular) * (x2 * x2 * x);
    return ((1.0 - fresnel) * f.diffuse * 0.31831 + fresnel * min(lobe, 40.0)) * nl;
#endif
}

vec3 lamp_reflected(Finish f, vec3 n, vec3 v, vec3 l) {
#ifdef QUICK
    return f.diffuse * (0.31831 * clamp(dot(n, l), 0.0, 1.0));
#else
    return reflected(f, n, v, l);
#endif
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

void main() {
    vec3 v = normalize(eye.xyz - place);
#ifdef FLAT
    vec3 n = vec3(0.0, 0.0, 1.0);
#else
    vec3 n = normalize(facing);
#endif
    vec3 color = own_color;
#ifdef TEXTURED
    vec3 texel = texture(textures, vec3(own_uv, own_finish.z)).rgb;
    color *= texel * texel;  // textures are stored as square roots of linear values
#endif
    float roughness = own_finish.x, metallic = own_finish.y;
    Finish f;
    f.alpha = roughness * roughness;
    f.roughness = roughness;
    f.diffuse = color * (1.0 - metallic);
    f.specular = mix(vec3(0.04), color, metallic);

    float open = openness();
#ifdef SUNLIT
    float lit = sunlit();
#else
    float lit = 1.0;
#endif
#if defined(FLAT) || defined(MATT)
    vec3 light = f.diffuse * (open * from_sky + lit * from_sun);
#else
    vec3 above = 0.5 * (zenith.rgb + horizon.rgb);
    vec3 light = f.diffuse * 0.31831 * open * mix(floor_glow.rgb, above, n.z * 0.5 + 0.5);
    vec3 r = reflect(-v, n);
    float x = 1.0 - clamp(dot(n, v), 0.0, 1.0), x2 = x * x;
    vec3 seen = mix(floor_glow.rgb, mix(horizon.rgb, zenith.rgb, clamp(r.z, 0.0, 1.0)), smoothstep(-0.15, 0.15, r.z));
    vec3 mirror = f.specular + (max(vec3(1.0 - roughness), f.specular) - f.specular) * (x2 * x2 * x);
    light += seen * 0.31831 * open * mirror * (1.0 - 0.5 * roughness);
    light += reflected(f, n, v, sun_direction.xyz) * sun_color.rgb * lit;
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
        // asphalt and grass reflect light back to its source: law of Lommel and Seeliger for rough ground
        light += f.diffuse * 0.31831 * arriving * l.z / (l.z + v.z + 0.02);
#else
        light += lamp_reflected(f, n, v, l) * arriving;
#endif
    }
    for (int i = 0; i < LAMPS; i++) {
        vec3 arriving = lamp_light(lamp_numbers[i], l);
        light += lamp_reflected(f, n, v, l) * arriving;
    }
    pixel = vec4(shown(light * exposure.x + own_emission * exposure.y), 1.0);
}
