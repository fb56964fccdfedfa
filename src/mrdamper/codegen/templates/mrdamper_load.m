function damper = mrdamper_load(file)
% MRDAMPER_LOAD  Load a damper that mrdamper has exported.
%   damper = mrdamper_load('damper.mat') returns a struct: title, law, parameters (name, value,
%   standard_error), card_json (the whole model card; jsondecode reads it) and map, with force_N over
%   (temperature_degC, command, velocity_m_s). Extension is positive; so is a force that resists it.
%
%   For Simulink's n-D Lookup Table: breakpoints damper.map.temperature_degC, .command, .velocity_m_s,
%   table damper.map.force_N (leave out a dimension that has one breakpoint).
if nargin < 1
  file = fullfile(fileparts(mfilename('fullpath')), 'damper.mat');
end
loaded = load(file);
damper = loaded.damper;
map = damper.map;
expected = [numel(map.temperature_degC), numel(map.command), numel(map.velocity_m_s)];
found = [size(map.force_N, 1), size(map.force_N, 2), size(map.force_N, 3)];
if ~isequal(found, expected)
  error('mrdamper:map', '%s: force_N is %dx%dx%d; expected %dx%dx%d', file, found, expected);
end
end
