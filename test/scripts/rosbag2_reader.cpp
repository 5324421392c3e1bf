// What rosbag2's own code makes of recordings: their metadata.yaml, and every message of every file, through the
// storage plugin for MCAP. Built and started by rosbag2_reader.py; one JSON object a recording and line.

#include <filesystem>
#include <iostream>
#include <map>
#include <memory>

#include "rosbag2_storage/metadata_io.hpp"
#include "rosbag2_storage/storage_interfaces/read_write_interface.hpp"
#include "rosbag2_storage/yaml.hpp"

using rosbag2_storage::storage_interfaces::ReadWriteInterface;

extern "C" ReadWriteInterface * make_storage();  // what pluginlib would load

static void tell(const std::string & path)
{
  const auto told = rosbag2_storage::MetadataIo().read_metadata(path);
  const auto begun = told.starting_time.time_since_epoch().count(), ended = begun + told.duration.count();
  std::map<std::string, size_t> counts;
  size_t read = 0, reversed = 0, outside = 0, definitions = 0, hashes = 0;
  int64_t last = 0;
  for (const auto & file : told.relative_file_paths) {
    std::unique_ptr<ReadWriteInterface> storage(make_storage());
    rosbag2_storage::StorageOptions options;
    options.uri = (std::filesystem::path(path) / file).string();
    options.storage_id = told.storage_identifier;
    storage->open(options, rosbag2_storage::storage_interfaces::IOFlag::READ_ONLY);
    for (const auto & topic : storage->get_all_topics_and_types()) {
      hashes += !topic.type_description_hash.empty();
    }
    std::vector<rosbag2_storage::MessageDefinition> found;
    storage->get_all_message_definitions(found);
    definitions += found.size();
    for (; storage->has_next(); ++read) {
      const auto message = storage->read_next();
      ++counts[message->topic_name];
      reversed += message->recv_timestamp < last;
      last = message->recv_timestamp;
      outside += last < begun || last > ended;
    }
  }
  std::cout << "{\"version\": " << told.version << ", \"storage\": \"" << told.storage_identifier << "\", \"told\": "
            << told.message_count << ", \"read\": " << read << ", \"seconds\": " << told.duration.count() * 1e-9
            << ", \"definitions\": " << definitions << ", \"hashes\": " << hashes << ", \"reversed\": " << reversed
            << ", \"outside\": " << outside << ", \"topics\": [";
  const char * comma = "";
  for (const auto & topic : told.topics_with_message_count) {
    const auto & about = topic.topic_metadata;
    std::cout << comma << "[\"" << about.name << "\", \"" << about.type << "\", " << topic.message_count << ", "
              << counts[about.name] << ", " << about.offered_qos_profiles.size() << "]";
    comma = ", ";
  }
  std::cout << "]}" << std::endl;
}

int main(int count, char ** arguments)
{
  for (int i = 1; i < count; ++i) {
    try {
      tell(arguments[i]);
    } catch (const std::exception & error) {
      std::cerr << error.what() << std::endl;
      return 1;
    }
  }
  return 0;
}
