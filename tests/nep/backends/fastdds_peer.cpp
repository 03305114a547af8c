// A program with Fast DDS, what ROS 2 has by default: `fastdds_peer hear|say TOPIC [latched]`, as dust_peer.py.

#include <cstdlib>
#include <cstring>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include <fastdds/dds/core/condition/WaitSet.hpp>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

using namespace eprosima::fastdds::dds;
using eprosima::fastdds::rtps::UDPv4TransportDescriptor;
using eprosima::fastrtps::types::ReturnCode_t;
using Payload = eprosima::fastrtps::rtps::SerializedPayload_t;

// std_msgs/msg/String as plain CDR, its numbers little-endian.
class StringType : public TopicDataType {
public:
    StringType() {
        setName("std_msgs::msg::dds_::String_");
        m_typeSize = 1024;
    }

    bool serialize(void* data, Payload* payload) override {
        const std::string& text = *static_cast<std::string*>(data);
        const uint32_t size = static_cast<uint32_t>(text.size()) + 1;
        if (8 + size > payload->max_size) return false;
        const unsigned char head[4] = {0, 1, 0, 0};
        std::memcpy(payload->data, head, 4);
        std::memcpy(payload->data + 4, &size, 4);
        std::memcpy(payload->data + 8, text.c_str(), size);
        payload->encapsulation = CDR_LE;
        payload->length = 8 + size;
        return true;
    }

    bool deserialize(Payload* payload, void* data) override {
        uint32_t size = 0;
        if (payload->length < 9) return false;
        std::memcpy(&size, payload->data + 4, 4);
        if (size < 1 || 8 + size > payload->length) return false;
        static_cast<std::string*>(data)->assign(reinterpret_cast<char*>(payload->data) + 8, size - 1);
        return true;
    }

    std::function<uint32_t()> getSerializedSizeProvider(void* data) override {
        return [data] { return 9 + static_cast<uint32_t>(static_cast<std::string*>(data)->size()); };
    }

    void* createData() override { return new std::string; }
    void deleteData(void* data) override { delete static_cast<std::string*>(data); }
    bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }
};

void tell(const std::string& line) { std::cout << line << std::endl; }

template <typename Entity>
void wait_for(Entity* entity, StatusMask status) {
    WaitSet waiting;
    ConditionSeq found;
    entity->get_statuscondition().set_enabled_statuses(status);
    waiting.attach_condition(entity->get_statuscondition());
    waiting.wait(found, eprosima::fastrtps::Duration_t(60, 0));
}

template <typename Qos>
Qos kept(Qos qos, bool is_latched) {
    qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
    qos.durability().kind = is_latched ? TRANSIENT_LOCAL_DURABILITY_QOS : VOLATILE_DURABILITY_QOS;
    qos.history().kind = KEEP_LAST_HISTORY_QOS;
    qos.history().depth = 100;
    return qos;
}

int hear(DomainParticipant* participant, Topic* topic, bool is_latched) {
    Subscriber* subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
    DataReader* reader = subscriber->create_datareader(topic, kept(DATAREADER_QOS_DEFAULT, is_latched));
    tell("ready");
    wait_for(reader, StatusMask::subscription_matched());
    tell("matched");
    for (;;) {
        wait_for(reader, StatusMask::data_available());
        std::string text;
        SampleInfo info;
        while (reader->take_next_sample(&text, &info) == ReturnCode_t::RETCODE_OK) {
            if (info.valid_data) tell(text);
        }
    }
}

int say(DomainParticipant* participant, Topic* topic, bool is_latched) {
    Publisher* publisher = participant->create_publisher(PUBLISHER_QOS_DEFAULT);
    DataWriter* writer = publisher->create_datawriter(topic, kept(DATAWRITER_QOS_DEFAULT, is_latched));
    tell("ready");
    for (std::string line; std::getline(std::cin, line);) writer->write(&line);
    return 0;
}

int main(int count, char** words) {
    if (count < 3) return 2;
    DomainParticipantQos qos = PARTICIPANT_QOS_DEFAULT;
    auto loopback = std::make_shared<UDPv4TransportDescriptor>();
    loopback->interfaceWhiteList.push_back("127.0.0.1");
    qos.transport().use_builtin_transports = false;  // nothing is left in shared memory
    qos.transport().user_transports.push_back(loopback);
    const int domain = std::atoi(std::getenv("ROS_DOMAIN_ID"));
    DomainParticipant* participant = DomainParticipantFactory::get_instance()->create_participant(domain, qos);
    TypeSupport type(new StringType);
    type.register_type(participant);
    Topic* topic = participant->create_topic(words[2], type.get_type_name(), TOPIC_QOS_DEFAULT);
    const bool is_latched = count > 3;
    return std::string(words[1]) == "hear" ? hear(participant, topic, is_latched) : say(participant, topic, is_latched);
}
