// Shaders of the scene: sun with shadows, sky, headlights with shadows, other lamps. The formulas are the files of the
// simulator cameras, so that both images agree.

import BEAM_FOG_FRAG from '../../../src/autodrive/graphics/render/shaders/beam_fog.frag?raw'
import BEAM_FOG from '../../../src/autodrive/graphics/render/shaders/beam_fog.vert?raw'
import LIGHT_FORMULAS from '../../../src/autodrive/graphics/render/shaders/light.glsl?raw'
import PRECIPITATION_FRAG from '../../../src/autodrive/graphics/render/shaders/precipitation.frag?raw'
import PRECIPITATION from '../../../src/autodrive/graphics/render/shaders/precipitation.vert?raw'
import SKY_LIGHT from '../../../src/autodrive/graphics/render/shaders/sky.glsl?raw'
import STRIP_FRAGMENT from '../../../src/autodrive/graphics/render/shaders/strip.frag?raw'
import STRIP from '../../../src/autodrive/graphics/render/shaders/strip.vert?raw'
import SHOWN from '../../../src/autodrive/graphics/render/shaders/tone.glsl?raw'
import { BEAM_SLOTS, LAMP_SLOTS } from './lamps'
import { BONES } from './skeleton'

export { STRIP_FRAGMENT }

export const CASTER_TILES = 4
export const CASTER_SLOTS = CASTER_TILES * CASTER_TILES

const LIGHT = /* glsl */ `
uniform vec3 sun_direction, sun_color, zenith, horizon;
uniform vec4 floor_glow;  // snow cover of the ground
uniform vec4 exposure;    // of reflected light, of emitted light, extinction of the air, wetness of the ground
uniform vec4 sun_place, dawn, extent;
uniform float dusk;
`

const TONE = /* glsl */ `
#ifndef LIGHTWEIGHT
#define EXACT
#endif
${SHOWN}
// Dithering with less than one level, against banding at night.
vec3 dithered(vec3 c) {
#ifdef LIGHTWEIGHT
  return c;
#endif
  float noise = fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
  return c + (noise - 0.5) / 255.0;
}
`

/** SKINNED: each vertex moves with one bone. Three.js declares position, normal, uv and the matrices. */
const BONE = /* glsl */ `
#ifdef SKINNED
uniform mat4 bone_poses[${BONES}];
in vec2 bones;  // bone, lamp
#define PLACE bone_poses[int(bones.x)]
#elif defined(USE_INSTANCING)
#define PLACE (modelMatrix * instanceMatrix)
#else
#define PLACE modelMatrix
#endif
`

export const DEPTH_VERTEX = /* glsl */ `
${BONE}
void main() { gl_Position = projectionMatrix * viewMatrix * PLACE * vec4(position, 1.0); }
`

export const DEPTH_FRAGMENT = /* glsl */ `
void main() {}
`

export const SCENE_VERTEX = /* glsl */ `
${LIGHT}
${BONE}
uniform mat3 sun_from_map;
uniform vec4 still_offset;  // w: offset of in_sun from the surface
#ifdef SKINNED
uniform float glows[13];  // 0: always on; 1 ... 12: the lamps
#endif
in vec3 color, emission, finish;
in float open;
out vec3 place, facing, in_sun;
flat out vec3 own_color, own_emission, own_finish;
out vec3 own_uv;  // and open
#ifdef LIGHTWEIGHT
out vec3 from_sky, from_sun;
#endif
void main() {
  mat4 pose = PLACE;
  place = (pose * vec4(position, 1.0)).xyz;
  facing = mat3(pose) * normal;
#ifdef SKINNED
  own_emission = emission * glows[int(bones.y)];
#else
  own_emission = emission;
#endif
  own_color = color;
  own_finish = finish;
  own_uv = vec3(uv, open);
  in_sun = sun_from_map * (place + still_offset.w * facing);  // offset from the surface, against shadow acne
#ifdef LIGHTWEIGHT
  from_sky = 0.31831 * mix(floor_glow.rgb, 0.5 * (zenith + horizon), facing.z * 0.5 + 0.5);
  from_sun = 0.31831 * clamp(dot(facing, sun_direction), 0.0, 1.0) * sun_color;
#endif
  gl_Position = projectionMatrix * viewMatrix * vec4(place, 1.0);
}
`

/** TEXTURED; SHADOWS: width of soft shadow edges [texels], 0: none; LIGHTWEIGHT: no reflections (software GL). */
export const SCENE_FRAGMENT = /* glsl */ `
precision highp sampler2DShadow;
${LIGHT}
uniform int is_day;
uniform sampler2D surface_image;
#ifdef STRIPS
uniform sampler2D strip_map;  // paint and shade of each pixel of level ground
#endif
uniform sampler2DShadow still_map, caster_map, beam_map;
uniform vec4 still_scale, still_offset;         // from in_sun to the shadow map of static objects
uniform int caster_count;
uniform vec4 caster_offset[${CASTER_SLOTS}];    // likewise for the tile of each vehicle
uniform vec4 caster_tile[${CASTER_SLOTS}];      // corner of the tile, half length and half width of the vehicle
uniform vec4 caster_place[${CASTER_SLOTS}];     // x, y of the vehicle centre, cosine and sine of its yaw
uniform vec4 tile_scale;                        // size of a tile and of a texel, from in_sun to place and depth in it
uniform int beam_count, head_count, lamp_count;
uniform vec4 lamp_place[${LAMP_SLOTS}], lamp_aim[${LAMP_SLOTS}], lamp_color[${LAMP_SLOTS}], lamp_up[${LAMP_SLOTS}];
uniform mat4 beam_from_map[${BEAM_SLOTS}];
uniform float beam_texel;
in vec3 place, facing, in_sun;
flat in vec3 own_color, own_emission, own_finish;
in vec3 own_uv;
#ifdef LIGHTWEIGHT
in vec3 from_sky, from_sun;
#endif
out vec4 pixel;
${TONE}
float shadow(sampler2DShadow map, vec3 at, float texel) {
#if SHADOWS < 2
  return texture(map, at);
#else
  // samples on a disc, rotated for each pixel
  float angle = 6.2831853 * fract(52.9829189 * fract(dot(gl_FragCoord.xy, vec2(0.06711056, 0.00583715))));
  float sum = 0.0, radius = texel * float(SHADOWS);
  for (int i = 0; i < 12; i++) {
    float turned = float(i) * 2.3999632 + angle;
    sum += texture(map, at + vec3(vec2(cos(turned), sin(turned)) * sqrt((float(i) + 0.5) / 12.0) * radius, 0.0));
  }
  return sum / 12.0;
#endif
}

float sunlit() {
#if SHADOWS == 0
  return 1.0;
#else
  vec3 at = in_sun * still_scale.xyz + still_offset.xyz;
  bool inside = all(lessThan(abs(at - 0.5), vec3(0.499)));
  float lit = shadow(still_map, inside ? at : vec3(0.5, 0.5, 0.0), still_scale.w);
  lit = inside ? lit : 1.0;
  for (int i = 0; i < caster_count; i++) {
    vec4 tile = caster_tile[i];
    at = in_sun * tile_scale.zzw + caster_offset[i].xyz;
    vec2 off = abs(at.xy - 0.5);
    if (max(off.x, off.y) < 0.48 && at.z < 1.0)  // filtering at the border would read the next tile
      lit = min(lit, shadow(caster_map, vec3(tile.xy + at.xy * tile_scale.x, at.z), tile_scale.y));
  }
  return lit;
#endif
}

${LIGHT_FORMULAS}
float openness() {
  float open = 1.0;
  for (int i = 0; i < caster_count; i++) {
    vec2 d = place.xy - caster_place[i].xy;
    if (dot(d, d) <= 0.15) open *= open_beside(caster_place[i], caster_tile[i].zw, d);
  }
  return open;
}

vec3 reflected(Finish f, bool is_glossy, vec3 n, vec3 v, vec3 l) {
#ifndef LIGHTWEIGHT
  if (is_glossy) return glossy(f, n, v, l);
#endif
  return matt(f, n, l);
}

// Light that arrives at the camera, with what the surface emits and what its water mirrors.
vec3 in_air(vec3 light, vec3 emission) {
  vec3 n = normalize(facing), v = normalize(cameraPosition - place);
#ifdef SKINNED
  if (is_day == 0) light += outlined(own_color, n, v);
#elif defined(WET)
  light += glint(n, v);
#endif
#ifndef SKINNED
  if (own_finish.z < 0.5 && place.z < 0.001) light = hazy(light, v);
#endif
#ifdef AIR
  float share = exp(-exposure.z * distance(cameraPosition, place));
  light = mix(horizon * 0.31831, light, share);
  emission *= share;
#endif
  return light * exposure.x + emission * exposure.y;
}

void main() {
  vec3 color = own_color;
  vec3 n = normalize(facing), v = normalize(cameraPosition - place);
  bool is_flat = own_finish.z < 0.5, is_glossy = own_finish.z > 1.5;
#ifdef TEXTURED
  vec3 texel = texture(surface_image, own_uv.xy).rgb;
#ifdef FINE
  float near = is_flat ? clamp(1.5 - 1.5 * distance(cameraPosition, place), 0.0, 1.0) : 0.0;
  vec3 fine = texture(surface_image, 3.1 * own_uv.xy).rgb;
  texel = sqrt(texel * mix(texel, fine, near));
  n = is_flat ? normalize(uneven(sqrt(fine.g), near)) : n;
#endif
  color *= texel;
#endif
#if defined(SKINNED) || !defined(TEXTURED)
  vec3 emission = own_emission;
#elif defined(WINDOWS)
  vec3 emission = is_flat ? vec3(0.0) : window_light(own_emission, texel, dusk, floor(own_uv.x), own_color + facing);
#else
  const vec3 emission = vec3(0.0);
#endif
  float open = openness() * own_uv.z;
#ifdef STRIPS
  vec2 strip = is_flat && place.z < 0.001 ? texelFetch(strip_map, ivec2(gl_FragCoord.xy), 0).rg : vec2(0.0);
  color = mix(color, PAINT, min(strip.r, 1.0));
  open *= 1.0 - min(strip.g, 0.8);
#endif
#if !defined(SKINNED) && (defined(WET) || defined(SNOW))
  color = weathered(color, normalize(facing));
#endif
  float lit = is_day == 1 ? sunlit() : 1.0;
  float roughness = own_finish.x, metallic = own_finish.y;
#ifdef LIGHTWEIGHT
  vec3 plain = color * (1.0 - 0.5 * metallic);
  vec3 light = plain * (open * from_sky + lit * from_sun);
  if (lamp_count == 0) {
    pixel = vec4(shown(in_air(light, emission)), 1.0);
    return;
  }
#endif
  Finish f;
  f.alpha = roughness * roughness;
  f.roughness = roughness;
  f.diffuse = color * (1.0 - metallic);
  f.specular = mix(vec3(0.04), color, metallic);
#ifdef LIGHTWEIGHT
  f.diffuse = plain;
#else
  vec3 light = f.diffuse * 0.31831 * open * around(n);
  if (is_glossy) light += mirrored(f, n, v, open);
  light += reflected(f, is_glossy, n, v, sun_direction) * sun_color * lit;
#endif
  vec3 l;
  for (int i = 0; i < head_count; i++) {
    vec3 arriving = lamp_light(i, l);
    if (arriving.g == 0.0) continue;
    arriving *= clamp(0.5 - dot(-l, lamp_up[i].xyz) * lamp_up[i].w, 0.0, 1.0);
#ifdef BEAM_SHADOWS
    if (i < beam_count) {
      vec4 at = beam_from_map[i] * vec4(place + 0.004 * n, 1.0);
      at.xyz /= max(at.w, 1e-4);  // points behind the lamp get no light
      arriving *= shadow(beam_map, at.xyz, beam_texel);
    }
#endif
    if (is_flat) light += rough(f, arriving, v, l) * step(0.0, l.z);
    else light += reflected(f, is_glossy, n, v, l) * arriving;
  }
  for (int i = head_count; i < lamp_count; i++) {
    vec3 arriving = lamp_light(i, l);
    light += reflected(f, is_glossy, n, v, l) * arriving;
  }
  pixel = vec4(dithered(shown(in_air(light, emission))), 1.0);
}
`

export const SKY_VERTEX = /* glsl */ `
uniform mat4 map_from_clip;
out vec3 ray;
void main() {
  vec4 near = map_from_clip * vec4(position.xy, -1.0, 1.0), far = map_from_clip * vec4(position.xy, 1.0, 1.0);
  ray = far.xyz / far.w - near.xyz / near.w;
  gl_Position = vec4(position.xy, 0.9999999, 1.0);
}
`

export const SKY_FRAGMENT = /* glsl */ `
${LIGHT}
#ifdef CLOUDS
uniform sampler2D clouds;
vec2 cloud_noise(vec2 at) { return sqrt(texture(clouds, at).rg); }
#endif
in vec3 ray;
out vec4 pixel;
${TONE}
${SKY_LIGHT}
void main() {
  vec3 d = normalize(ray), seen = sky_light(d);
#ifdef AIR
  seen = mix(horizon * 0.31831, seen, exp(-3.0 * exposure.z / (max(d.z, 0.0) + 0.02)));
#endif
  pixel = vec4(dithered(shown(seen * exposure.x)), 1.0);
}
`

/** Uniforms instead of the uniform blocks of the simulator cameras. */
const BLOCKS = /* glsl */ `
${LIGHT}
uniform vec4 lamp_place[${LAMP_SLOTS}], lamp_aim[${LAMP_SLOTS}], lamp_color[${LAMP_SLOTS}];
`

function ofCameras(shader: string): string {
  return shader
    .replace(/layout.*/, BLOCKS)
    .replace('TONE', SHOWN)
    .replace('LIGHT_FORMULAS', LIGHT_FORMULAS)
}

/** Light of headlights in fog, rain and snow before the camera, and strips on the ground: the shaders of the cameras. */
export const PRECIPITATION_VERTEX = ofCameras(PRECIPITATION)
export const PRECIPITATION_FRAGMENT = PRECIPITATION_FRAG.replace('DOWN', '-1.0')
export const BEAM_FOG_VERTEX = ofCameras(BEAM_FOG)
export const BEAM_FOG_FRAGMENT = ofCameras(BEAM_FOG_FRAG)
export const STRIP_VERTEX = STRIP.replace(/layout.*/, 'uniform mat4 clip_from_map;')
